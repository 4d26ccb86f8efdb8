"""Arguments of every verb that reads recorded runs: the bags, and the rig that they are of."""

from __future__ import annotations

import argparse

RIG = "paper_high_impedance"
"""The rig of a verb that is not given one."""
_RIGS = "rig file, or the name of one in config/rigs"


def add_runs(parser: argparse.ArgumentParser, several: str = "") -> None:
    """Declare the bags. several: what more than one of them are."""
    about = f"rosbag2 directory, .mcap or .db3{f'; {several}' if several else ''}"
    parser.add_argument("bags", nargs="+", metavar="BAG", help=about)


def add_rig(parser: argparse.ArgumentParser, about: str = _RIGS) -> None:
    """Declare --rig."""
    parser.add_argument("--rig", default=RIG, help=f"{about} (default %(default)s)")
