"""Numbers on the command line."""

from __future__ import annotations

import argparse
import math


def seed(text: str) -> int:
    """Return the seed of random numbers. Raises ArgumentTypeError for what is no whole number >= 0."""
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"{text!r}, expected a whole number >= 0")
    return int(text)


def positive(text: str) -> float:
    """Return a finite number > 0. Raises ArgumentTypeError for any other."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and value > 0.0):
        raise argparse.ArgumentTypeError(f"{text!r}, expected a number > 0")
    return value
