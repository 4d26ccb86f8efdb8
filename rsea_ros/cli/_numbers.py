"""Numbers on the command line."""

from __future__ import annotations

import argparse
import math


def whole_number(text: str) -> int:
    """Return a whole number >= 0. Raises ArgumentTypeError for anything else."""
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


def whole_numbers(text: str) -> tuple[int, ...]:
    """Return the numbers of `2`, `0,1,2` or `0-5`, each once. Raises ArgumentTypeError for another text."""
    numbers: list[int] = []
    for part in text.split(","):
        first, dash, last = (side.strip() for side in part.partition("-"))
        if not (first.isdecimal() and len(first) < 5 and (not dash or (last.isdecimal() and len(last) < 5))):
            raise argparse.ArgumentTypeError(f"{text!r}, expected whole numbers >= 0: 2, or 0,1,2, or 0-5")
        numbers += range(int(first), int(last if dash else first) + 1)
    if not numbers:
        raise argparse.ArgumentTypeError(f"{text!r}, expected the smaller number first")
    return tuple(dict.fromkeys(numbers))
