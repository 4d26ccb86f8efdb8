"""A number that steers a result, declared with its meaning, its unit and the reason for its value."""

from __future__ import annotations

from dataclasses import field
from typing import Any, NamedTuple, TypeVar

T = TypeVar("T")


class Setting(NamedTuple):
    """One setting as a report shows it. name: `group.field`."""

    name: str
    value: Any
    unit: str
    meaning: str
    reason: str


def number(value: T, unit: str, meaning: str, reason: str) -> T:
    """Declare a field of a group of settings, a frozen dataclass, with its meaning, unit and reason."""
    described = {"unit": unit, "meaning": meaning, "reason": reason}
    return field(default=value, metadata=described)
