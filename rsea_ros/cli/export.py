"""`rsea export`: a rig for other programs."""

from __future__ import annotations

import argparse
from pathlib import Path

from rsea_ros.cli._output import add_force
from rsea_ros.new_files import check_free, write_text

HELP = "a rig as a model for another program: MJCF for MuJoCo"
EXAMPLE = "rsea export --mjcf paper_high_impedance --out bench.xml"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    parser.add_argument(
        "--rig",
        "--mjcf",
        required=True,
        metavar="RIG",
        help="rig or model.yaml, or the name of one in config/rigs; as MJCF, the only format so far",
    )
    parser.add_argument("--out", type=Path, help="file to be written (default NAME.xml)")
    add_force(parser)


def run(args: argparse.Namespace) -> int:
    """Write the file and print its name."""
    from rsea_ros.design.mjcf import mjcf
    from rsea_ros.model.rig_file import load_rig

    rig = load_rig(args.rig)
    out = args.out or Path(f"{rig.name}.xml")
    check_free([out], force=args.force, inputs=[args.rig])
    print(write_text(out, mjcf(rig), force=args.force))
    return 0
