"""Code from outside the package: files by an environment variable, and what packages register.

A package registers verbs, export targets and nodes as entry points. Those of rsea_extras stand in a file
beside its code, which setup.py reads too: a source tree has no metadata, and for a verb of this package
nobody looks through the metadata of all that is installed.
"""

import importlib.util
import os
import sys
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path
from typing import TypeVar

from rsea_ros.errors import ParameterError

T = TypeVar("T")
EXTRAS = "rsea_extras"
VERBS, TARGETS, NODES = "rsea_ros.verbs", "rsea_ros.exports", "rsea_ros.nodes"
"""Groups of entry points."""
_FILE = "entry_points.txt"
_NODES = Path(__file__).with_name("nodes")


@cache
def in_extras(group: str) -> dict[str, str]:
    """Return what rsea_extras registers in a group, modules by name; nothing where it is not installed."""
    spec = importlib.util.find_spec(EXTRAS)
    folders = spec.submodule_search_locations if spec and spec.submodule_search_locations else []
    return _stated(group, [Path(folder, _FILE) for folder in folders])


@cache
def installed(group: str) -> dict[str, str]:
    """Return what all installed packages register in a group: modules, or their functions, by name.

    Read from the files that importlib.metadata would read: to import that takes 25 ms. Metadata of the extras
    may outlive their code, and is passed over.
    """
    files = (file for folder in reversed(sys.path) for file in Path(folder).glob(f"*-info/{_FILE}"))
    stated = _stated(group, files).items()
    return {name: place for name, place in stated if not place.startswith(f"{EXTRAS}.")} | in_extras(group)


def _stated(group: str, files: Iterable[Path]) -> dict[str, str]:
    """Return what files of entry points state in a group."""
    texts = (file.read_text(encoding="utf-8") for file in files if file.is_file())
    parts = (part for text in texts for part in f"\n{text}".split("\n[") if part.startswith(f"{group}]"))
    pairs = (line.partition("=") for part in parts for line in part.splitlines()[1:])
    return {name.strip(): value.strip() for name, _, value in pairs if value}


def registered(group: str, name: str) -> str:
    """Return what is registered in a group under a name, empty for nothing."""
    return in_extras(group).get(name) or installed(group).get(name, "")


def not_installed(what: str) -> ParameterError:
    """Return the error for a part of rsea_extras where that is not installed."""
    install = "pip install . in the source of rsea_ros"
    return ParameterError(f"{EXTRAS}: not installed, expected for {what}: {install}")


def node_modules() -> dict[str, str]:
    """Return the module of every node by the name of its executable."""
    own = {path.stem: f"rsea_ros.nodes.{path.stem}" for path in _NODES.glob("[!_]*.py")}
    return dict(sorted({**own, **in_extras(NODES)}.items()))


def plugin_files(paths: str) -> Iterator[Path]:
    """Yield the files of a list of files and folders, separated like PATH; not those with a leading _."""
    for item in filter(None, paths.split(os.pathsep)):
        path = Path(item)
        yield from sorted(path.glob("[!_]*.py")) if path.is_dir() else [path]


def plugin_constant(variable: str, path: str, name: str, kind: type[T]) -> T:
    """Run a file and return one of its constants. Raises ParameterError for a file that lacks it or fails.

    variable: the environment variable that named the file. kind: type of the constant.
    """
    spec = importlib.util.spec_from_file_location(Path(path).stem, path)
    if spec is None or spec.loader is None or not Path(path).exists():
        expected = f"expected a Python file with {'an' if name[0] in 'AEIOU' else 'a'} {name}"
        raise ParameterError(f"{variable}: {path}: no such file, {expected}")
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        raise ParameterError(f"{variable}: {path}: {type(error).__name__}: {error}") from error
    constant = getattr(module, name, None)
    if not isinstance(constant, kind):
        expected = f"expected a constant of type {kind.__name__}"
        raise ParameterError(f"{variable}: {path}: no {name} in it, {expected}")
    return constant
