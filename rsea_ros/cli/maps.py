"""`rsea maps`: the import maps that come with the package, those in config/imports."""

import argparse
from pathlib import Path

from msg_adapters.tables import load_map
from rsea_ros.cli._terminal import columns, say
from rsea_ros.errors import ParameterError
from rsea_ros.model.rig_file import packaged, packaged_names

HELP = "list the import maps of the package, with a description of each measurement"
EXAMPLE = "rsea maps"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Take no arguments."""


def run(args: argparse.Namespace) -> int:
    print(columns([(name, load_map(map_path(name)).about) for name in packaged_names("imports")]))
    print()
    say("rsea import FILE --map NAME uses one; docs/import.md shows how to write your own.")
    return 0


def map_path(name: str) -> Path:
    """Return the file of a map given by path, or by the bare name of one in config/imports.

    Raises ParameterError for any other name.
    """
    path = Path(name)
    return path if path.suffix or path.exists() else packaged("map", name, "imports", ParameterError)
