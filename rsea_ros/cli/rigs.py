"""`rsea rigs`: the rigs that come with the package."""

import argparse

from rsea_ros.cli._terminal import columns, say

HELP = "list the rigs of the package, with a description of each bench"
EXAMPLE = "rsea rigs"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Take no arguments."""


def run(args: argparse.Namespace) -> int:
    from rsea_ros.model.rig_file import load_rig, packaged_names

    print(columns([(name, load_rig(name).about) for name in packaged_names()]))
    print()
    say("rsea rig check NAME shows the values of a rig; rsea rig new NAME starts a new one.")
    return 0
