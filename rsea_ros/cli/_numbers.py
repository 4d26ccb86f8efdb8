"""Numbers on the command line."""

from __future__ import annotations

import argparse


def seed(text: str) -> int:
    """Return the seed of random numbers. Raises ArgumentTypeError for what is no whole number >= 0."""
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"{text!r}, expected a whole number >= 0")
    return int(text)
