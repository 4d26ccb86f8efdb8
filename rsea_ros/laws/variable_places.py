"""Which variables a law reads, and their places in the signal table."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np

from rsea_ros.laws.law import Law

READS = {"w": "GEAR_VELOCITY", "q": "OUTPUT_ANGLE", "theta": "ROTOR_ANGLE", "d": "DEFLECTION", "T": "LOAD",
          "u": "COMMAND", "h": "HOUSING_ANGLE"}  # fmt: skip


def words_of(expression: str) -> set[str]:
    return set(re.findall(r"[a-z_A-Z]+", expression))


def time_letters(law: Law) -> set[str]:
    words = {w for part in law.parts for w in words_of(part.term.expression)}
    if law.curve is not None:
        words |= {law.curve.over, law.curve.factor}
    return words & {"t", "share"}


def letters_of(law: Law) -> set[str]:
    """Return the letters of the variables that a law reads."""
    used: set[str] = set()
    for part in law.parts:
        used |= words_of(part.term.expression) & set(READS)
        used |= {"w"} if part.term.friction else set()
        used |= {part.term.remembers} if part.term.memory else set()
    if law.curve is not None:
        used |= {law.curve.over, law.curve.factor} & set(READS)
        used |= {"w"} if law.curve.factor == "w" else set()
    return used


def ranges_of(law: Law, letters: Mapping[str, np.ndarray]) -> dict[str, float]:
    """Return the largest size of each variable that a law reads."""
    return {n: float(np.max(np.abs(letters[n]))) for n in READS if n in letters_of(law)}
