"""Keys of a YAML document with the values that each expects. Parsers and the tables of the docs read them."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

NEEDED = "required"


@dataclass(frozen=True)
class Key:
    """A key of a mapping: the expected value, the default, and the meaning."""

    name: str
    expects: str
    default: str
    meaning: str = ""


def names(keys: Collection[Key]) -> set[str]:
    """Return the names of keys."""
    return {key.name for key in keys}


def table(section: str, keys: Sequence[Key]) -> str:
    """Return a table of keys in Markdown."""
    head = [f"`{section}`:", "", "| key | expected | default | meaning |", "|---|---|---|---|"]
    return "\n".join([*head, *map(_row, keys)]) + "\n"


def _row(key: Key) -> str:
    cells = (f"`{key.name}`", key.expects.replace("|", "\\|"), key.default, key.meaning)
    return f"| {' | '.join(cells)} |"
