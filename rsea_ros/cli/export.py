"""`rsea export`: a rig for other programs."""

from __future__ import annotations

import argparse
from pathlib import Path

HELP = "a rig as a model for another program: MJCF for MuJoCo"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    parser.add_argument(
        "--mjcf",
        required=True,
        metavar="RIG.yaml",
        help="rig or model.yaml, or the name of one in config/rigs",
    )
    parser.add_argument("--out", type=Path, help="file to be written (default NAME.xml)")


def run(args: argparse.Namespace) -> int:
    """Write the file and print its name."""
    from rsea_ros.design.mjcf import mjcf
    from rsea_ros.model.rig_file import load_rig
    from rsea_ros.report.results import write_text

    rig = load_rig(args.mjcf)
    print(write_text(args.out or Path(f"{rig.name}.xml"), mjcf(rig)))
    return 0
