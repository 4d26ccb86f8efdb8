"""Remarks of a writer in a bag: notes, and data that an import left out.

A directory keeps it in metadata.yaml, a single MCAP file in a metadata record named `rsea`.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from rsea_ros.documents.wording import brief
from rsea_ros.records.record import Fault

NAME = "rsea"
NOTES, FAULTS = "rsea_notes", "rsea_faults"
KEPT = frozenset({"rows_left_out", "missing_values", "coarse_stamps"})
"""Faults that no reader of the bag could find again."""
_LONGEST, _MOST = 500, 50


@dataclass(frozen=True)
class Remarks:
    """Notes and faults of a bag."""

    notes: Sequence[str] = ()
    faults: Sequence[Fault] = ()

    def texts(self) -> dict[str, str]:
        """Return both as texts by name, those that there are."""
        kept = [[f.kind, f.channel, f.share, f.detail] for f in self.faults if f.kind in KEPT]
        texts = {NOTES: "\n".join(self.notes), FAULTS: json.dumps(kept, allow_nan=False) if kept else ""}
        return {name: text for name, text in texts.items() if text}


def remarks_of(texts: Mapping[Any, object]) -> Remarks:
    """Return this project's remarks among texts by name."""
    notes, faults = (text if isinstance(text, str) else "" for text in map(texts.get, (NOTES, FAULTS)))
    lines = [brief(line, _LONGEST) for line in notes.splitlines()[:_MOST] if "\0" not in line]
    return Remarks(lines, _faults(faults))


def _faults(text: str) -> list[Fault]:
    try:
        rows = json.loads(text) if text else []
    except (ValueError, RecursionError):
        return []
    faults = [_fault(row) for row in rows[:_MOST]] if isinstance(rows, list) else []
    return [fault for fault in faults if fault is not None]


def _fault(row: object) -> Fault | None:
    """Return the fault of a row [kind, channel, share, detail], None for anything else."""
    match row:
        case [str(kind), str(channel), float() | int() as share, str(detail)] if kind in KEPT:
            whole = share if 0.0 <= share <= 1.0 else math.nan
            return Fault(kind, brief(channel, _LONGEST), float(whole), brief(detail, _LONGEST))
    return None
