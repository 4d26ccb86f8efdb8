"""`rsea maps`: the import maps that come with the package."""

from __future__ import annotations

import argparse

HELP = "list the import maps of the package, with a description of each measurement"
EXAMPLE = "rsea maps"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Take no arguments."""


def run(args: argparse.Namespace) -> int:
    """Print a line for each map."""
    from msg_adapters.tables import load_map
    from rsea_ros.cli._columns import columns
    from rsea_ros.cli._lines import say
    from rsea_ros.cli._maps import map_names, map_path

    print(columns([(name, load_map(map_path(name)).about) for name in map_names()]))
    print()
    say("rsea import FILE --map NAME uses one; docs/import.md shows how to write your own.")
    return 0
