"""Fields of a document: the keys that it may have, and each value checked with its unit and range."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from rsea_ros.documents.units import plain, same_unit
from rsea_ros.documents.wording import did_you_mean, quote
from rsea_ros.errors import FieldError


def number(value: Any, name: str, unit: str) -> float:
    """Return a YAML value as a float. Raises FieldError when it is not a number."""
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    try:
        converted = float(value) if is_number else math.nan
    except OverflowError:
        converted = math.nan
    if math.isnan(converted):
        raise FieldError(f"{name} = {quote(value)}, expected a number ({plain(unit) or 1})", name)
    return converted


def interval(value: Any, name: str, unit: str) -> tuple[float, float]:
    """Return [low, high] as two floats. Raises FieldError for anything else."""
    if not isinstance(value, list) or len(value) != 2:
        raise FieldError(f"{name} = {quote(value)}, expected [low, high] in {plain(unit)}", name)
    low, high = (number(v, name, unit) for v in value)
    return low, high


def switch(body: Mapping[str, Any], name: str) -> bool:
    """Return true or false of a group. Raises FieldError when it is something else."""
    value = body.get(name.split(".")[-1], False)
    if not isinstance(value, bool):
        raise FieldError(f"{name} = {quote(value)}, expected true or false", name)
    return value


def text(value: Any, name: str) -> str:
    """Return a text. Raises FieldError for a value of another type."""
    if not isinstance(value, str):
        raise FieldError(f"{name} = {quote(value)}, expected text", name)
    return value


def mapping(value: Any, name: str, expected: str = "a mapping") -> Mapping[str, Any]:
    """Return a mapping. Raises FieldError for a value of another type."""
    if not isinstance(value, Mapping):
        raise FieldError(f"{name} = {quote(value)}, expected {expected}", name)
    return value


def only_keys(body: Mapping[str, Any], allowed: set[str], where: str) -> None:
    """Raise FieldError for a key that is not allowed."""
    for key in body:
        if key not in allowed:
            expected = ", ".join(sorted(allowed)) + did_you_mean(str(key), allowed)
            raise FieldError(
                f"{where}: unknown key {quote(key)}, expected one of {expected}", f"{where}.{key}"
            )


def unit(value: Any, name: str, expected: str) -> None:
    """Raise FieldError for another unit than the one expected, however that is written."""
    if not same_unit(value, expected):
        raise FieldError(f"{name} = {quote(value)}, expected {expected!r}", name)


NEEDED = "required"


@dataclass(frozen=True)
class Key:
    """A key of a mapping: the expected value, the default, and the meaning."""

    name: str
    expects: str
    default: str
    meaning: str = ""


def names(keys: Collection[Key]) -> set[str]:
    """Return the names of keys."""
    return {key.name for key in keys}


def table(section: str, keys: Sequence[Key]) -> str:
    """Return a table of keys in Markdown."""
    head = [f"`{section}`:", "", "| key | expected | default | meaning |", "|---|---|---|---|"]
    return "\n".join([*head, *map(_row, keys)]) + "\n"


def _row(key: Key) -> str:
    cells = (f"`{key.name}`", key.expects.replace("|", "\\|"), key.default, key.meaning)
    return f"| {' | '.join(cells)} |"
