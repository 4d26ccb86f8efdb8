"""One number that steers a verdict, with its meaning, its unit and the reason for its value."""

from __future__ import annotations

from dataclasses import field
from typing import Any, NamedTuple, TypeVar

T = TypeVar("T")
CHOSEN = "chosen on the benchmark; bench/settings_curve.py shows the outcomes over it"
CALIBRATED = "fixed when coefficients.py was fitted: after a change, `bench/calibration.py fit`"


def flat(low: str, high: str) -> str:
    """Return the reason of a number whose outcomes do not change over a range."""
    return f"flat from {low} to {high} on the short records of docs/settings.md: between what was tried"


class Setting(NamedTuple):
    """One setting as a report shows it. name: `group.field`."""

    name: str
    value: Any
    unit: str
    meaning: str
    reason: str


def number(value: T, unit: str, meaning: str, reason: str = CHOSEN) -> T:
    """Declare a setting of a group with its meaning, unit and reason."""
    described = {"unit": unit, "meaning": meaning, "reason": reason}
    return field(default=value, metadata=described)
