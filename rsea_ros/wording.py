"""Names and values in a sentence."""

from __future__ import annotations

from collections.abc import Sequence


def listed(names: Sequence[str], last: str = "and") -> str:
    """Return names as `a, b and c`; last: the word before the last of them."""
    return f" {last} ".join([", ".join(names[:-1]), names[-1]] if names[1:] else names)


def shown(value: object, longest: int = 60) -> str:
    """Return a value as it stands in a message: quoted, and cut where it is long."""
    text = repr(value)
    return text if len(text) <= longest else f"{text[: longest - 1]}…"
