"""`rsea maps`: the import maps that come with the package.

Import maps by name: those in config/imports, beside the rigs.
"""

import argparse
from pathlib import Path

from msg_adapters.tables import load_map
from rsea_ros.cli._terminal import columns, say
from rsea_ros.documents.wording import did_you_mean
from rsea_ros.errors import ParameterError
from rsea_ros.model.rig_file import rig_folders

HELP = "list the import maps of the package, with a description of each measurement"
EXAMPLE = "rsea maps"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Take no arguments."""


def run(args: argparse.Namespace) -> int:
    print(columns([(name, load_map(map_path(name)).about) for name in map_names()]))
    print()
    say("rsea import FILE --map NAME uses one; docs/import.md shows how to write your own.")
    return 0


def map_names() -> list[str]:
    return sorted({path.stem for folder in _folders() for path in folder.glob("*.yaml")})


def map_path(name: str) -> Path:
    """Return the file of a map given by path, or by the bare name of one in config/imports.

    Raises ParameterError for any other name.
    """
    path = Path(name)
    if path.suffix or path.exists():
        return path
    for folder in _folders():
        if (folder / f"{name}.yaml").exists():
            return folder / f"{name}.yaml"
    known = map_names()
    near = did_you_mean(name, known)
    raise ParameterError(f"map {name!r} not found, expected a YAML file or one of {', '.join(known)}{near}")


def _folders() -> list[Path]:
    return [folder.parent / "imports" for folder in rig_folders()]
