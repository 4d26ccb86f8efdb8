"""Keys of a YAML document: what each expects. Parsers take their names from them, the docs their tables."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

NEEDED = "needed"


@dataclass(frozen=True)
class Key:
    """A key of a mapping: what it expects, what holds where it is left out, what it means."""

    name: str
    expects: str
    default: str
    meaning: str = ""


def names(keys: Collection[Key]) -> set[str]:
    """Return the names of keys."""
    return {key.name for key in keys}


def table(section: str, keys: Sequence[Key]) -> str:
    """Return a table of keys in Markdown."""
    head = [f"`{section}`:", "", "| key | expects | without it | meaning |", "|---|---|---|---|"]
    return "\n".join([*head, *map(_row, keys)]) + "\n"


def _row(key: Key) -> str:
    cells = (f"`{key.name}`", key.expects.replace("|", "\\|"), key.default, key.meaning)
    return f"| {' | '.join(cells)} |"
