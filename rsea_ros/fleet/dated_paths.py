"""Dates in the paths of recordings whose stamps have none."""

from __future__ import annotations

import re
from datetime import datetime, timezone

_LETTERS = {"Y": r"\d{4}", "m": r"\d{2}", "d": r"\d{2}", "H": r"\d{2}", "M": r"\d{2}", "S": r"\d{2}",
            "y": r"\d{2}", "j": r"\d{3}", "f": r"\d{1,6}", "b": r"[A-Za-z]{3}"}  # fmt: skip
"""Directives of strptime that a pattern may have, as regular expressions."""
_SAMPLE = datetime(2001, 2, 3, tzinfo=timezone.utc)
"""A day that a pattern has to name."""


def date_in(path: str, pattern: str) -> datetime | None:
    """Return the last date in a path that matches a strptime pattern, or None."""
    parts = re.split(r"%(.)", pattern)
    letters = [_LETTERS.get(part, re.escape(part)) for part in parts[1::2]]
    texts = [re.escape(part) for part in parts[::2]]
    expression = "".join(text + letter for text, letter in zip(texts, [*letters, ""], strict=True))
    for text in reversed(re.findall(expression, path)):
        try:
            return datetime.strptime(text, pattern).replace(tzinfo=timezone.utc)
        except ValueError:
            continue
    return None


def names_a_day(pattern: str) -> bool:
    """Return whether a pattern has known directives only, and year, month and day among them."""
    if not set(re.findall(r"%(.?)", pattern)) <= {*_LETTERS, "%"}:
        return False
    return date_in(_SAMPLE.strftime(pattern), pattern) == _SAMPLE
