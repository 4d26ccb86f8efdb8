"""The summary of a run over some recordings."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field


@dataclass
class RunSummary:
    """The summary of a run.

    outcomes: rows written, by outcome. before: rows that the store had. unmapped: recordings that hold no
    joint, example: one of them. undated: rows without a time. changed: recordings that were being written,
    unreadable: those that could not be read, with the reason; the next run tries both again. quarantined:
    joint, recording and reason of each such row.
    """

    outcomes: Counter[str] = field(default_factory=Counter)
    before: int = 0
    unmapped: int = 0
    example: str = ""
    undated: int = 0
    changed: list[str] = field(default_factory=list)
    unreadable: list[str] = field(default_factory=list)
    quarantined: list[tuple[str, str, str]] = field(default_factory=list)

    @property
    def rows(self) -> int:
        """How many rows were written."""
        return sum(self.outcomes.values())

    def sentence(self) -> str:
        """Return all counts as one line."""
        parts = [f"{n} {outcome}" for outcome, n in sorted(self.outcomes.items())] or ["nothing new"]
        others = {
            "in the store before": self.before,
            "changed while read": len(self.changed),
            "unreadable": len(self.unreadable),
            "of no joint": self.unmapped,
            "without a date": self.undated,
        }
        return ", ".join([*parts, *(f"{n} {name}" for name, n in others.items() if n)])
