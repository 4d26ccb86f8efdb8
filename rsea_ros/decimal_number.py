"""Numbers in texts of people: plain decimals only."""

from __future__ import annotations

import math
import re

_DECIMAL = re.compile(r"[-+]?([0-9]+(\.[0-9]*)?|\.[0-9]+)([eE][-+]?[0-9]+)?")


def is_decimal(text: str) -> bool:
    """Return whether a text is a number like `12`, `-0.5` or `1e-3` that a double can hold.

    `0x10`, `1_000`, `1:30`, `1,5`, `nan`, `inf` and `1e999` are not.
    """
    return bool(_DECIMAL.fullmatch(text)) and math.isfinite(float(text))


def decimal(text: str) -> float:
    """Return the number. Raises ValueError where `is_decimal` is false; blanks around it do not count."""
    if not is_decimal(text.strip()):
        raise ValueError(f"{text!r} is not a finite decimal number")
    return float(text)
