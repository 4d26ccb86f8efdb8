"""Python files from outside the package, by an environment variable: effects, devices."""

import importlib.util
import os
from collections.abc import Iterator
from pathlib import Path
from typing import TypeVar

from rsea_ros.errors import ParameterError

T = TypeVar("T")


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
