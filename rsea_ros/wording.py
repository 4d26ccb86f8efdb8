"""Names in a sentence."""

from __future__ import annotations

from collections.abc import Sequence

_LONGEST = 60


def listed(names: Sequence[str], last: str = "and") -> str:
    """Return names as `a, b and c`; last: the word before the last of them."""
    return f" {last} ".join([", ".join(names[:-1]), names[-1]] if names[1:] else names)


def brief(text: str, longest: int = _LONGEST) -> str:
    """Return a text of unknown origin fit for a message: one line, no control characters, not too long."""
    cut = text[: longest + 1]
    plain = "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in cut[:longest])
    return plain + ("…" if len(cut) > longest else "")
