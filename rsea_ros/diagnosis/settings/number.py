"""Reasons that several settings of a diagnosis share."""

from __future__ import annotations

from typing import TypeVar

from rsea_ros.documents import setting

T = TypeVar("T")
CHOSEN = "chosen on the benchmark; bench/settings_curve.py shows the outcomes over it"
CALIBRATED = "fixed when coefficients.py was fitted: after a change, `bench/calibration.py fit`"


def flat(low: str, high: str) -> str:
    """Return the reason of a number whose outcomes do not change over a range."""
    return f"flat from {low} to {high} on the short records of docs/settings.md: between what was tried"


def number(value: T, unit: str, meaning: str, reason: str = CHOSEN) -> T:
    """Declare a setting of a group with its meaning, unit and reason."""
    return setting.number(value, unit, meaning, reason)
