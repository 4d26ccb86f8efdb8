"""Values out of a YAML document, checked: each error names the field, the value and what was expected."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from rsea_ros.errors import RigError


def number(value: Any, name: str, unit: str) -> float:
    """Return a YAML value as a float. Raises RigError when it is not a number."""
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    try:
        converted = float(value) if is_number else math.nan
    except OverflowError:
        converted = math.nan
    if math.isnan(converted):
        raise RigError(f"{name} = {value!r}, expected a number ({unit})")
    return converted


def switch(body: Mapping[str, Any], name: str) -> bool:
    """Return true or false of a group. Raises RigError when it is something else."""
    value = body.get(name.split(".")[-1], False)
    if not isinstance(value, bool):
        raise RigError(f"{name} = {value!r}, expected true or false")
    return value


def text(value: Any, name: str) -> str:
    """Return a text. Raises RigError when it is none."""
    if not isinstance(value, str):
        raise RigError(f"{name} = {value!r}, expected text")
    return value


def mapping(value: Any, name: str, expected: str = "a mapping") -> Mapping[str, Any]:
    """Return a mapping. Raises RigError when it is none."""
    if not isinstance(value, Mapping):
        raise RigError(f"{name} = {value!r}, expected {expected}")
    return value


def only_keys(body: Mapping[str, Any], allowed: set[str], where: str) -> None:
    """Raise RigError for a key that is not allowed."""
    for key in body:
        if key not in allowed:
            raise RigError(f"{where}: unknown key {key!r}, expected one of {', '.join(sorted(allowed))}")
