"""What a bag contains, and remarks on it.

A directory keeps it in metadata.yaml, a single MCAP file in a metadata record named `rsea`.
"""

from __future__ import annotations

import json
import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field

from rsea_ros.documents.wording import brief
from rsea_ros.records.record import Fault

AND = " and "
"""Between the types of a topic that has several."""


@dataclass
class Messages:
    """Serialised messages of one topic with their log times (ns), in the order of the file."""

    msgtype: str
    log_times: list[int] = field(default_factory=list)
    raw: list[bytes] = field(default_factory=list)


@dataclass
class Contents:
    """All topics of a file or bag, the requested messages, and faults and notes of reading.

    wanted: topics whose messages are kept, None for all.
    faults: damage, with counts and places. notes: assumptions.
    """

    wanted: Collection[str] | None = None
    topics: dict[str, Messages] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    faults: list[Fault] = field(default_factory=list)

    def wants(self, topic: str) -> bool:
        """Return whether the messages of a topic are kept."""
        return self.wanted is None or topic in self.wanted

    def sink(self, topic: str, msgtype: str) -> Messages | None:
        """Declare a topic; return where its messages go, None where nobody wants them."""
        messages = self.topics.setdefault(topic, Messages(msgtype))
        if msgtype not in messages.msgtype.split(AND):
            messages.msgtype += f"{AND}{msgtype}"
        return messages if self.wants(topic) else None

    def tell(
        self,
        kind: str,
        where: str,
        detail: str,
        size: float | None = None,
        unit: str = "",
        share: float = math.nan,
    ) -> None:
        """Add a fault of a topic or a file, once if two sources report it."""
        if not any((f.kind, f.channel, f.size) == (kind, where, size) for f in self.faults):
            self.faults.append(Fault(kind, where, share, detail, size, unit))

    def take(self, remarks: Remarks) -> None:
        """Add notes and faults that a bag keeps."""
        self.notes.extend(remarks.notes)
        self.faults.extend(remarks.faults)

    def compare(self, topic: str, expected: int, got: int, witness: str) -> None:
        """Report topics with fewer or more messages than another count says."""
        if not self.wants(topic) or got == expected:
            return
        kind = "missing_messages" if got < expected else "surplus_messages"
        share = (expected - got) / expected if got < expected else math.nan
        detail = f"{got} read, {expected} expected from {witness}"
        self.tell(kind, topic, detail, abs(expected - got), "messages", share)

    def remarks(self) -> str:
        """Return notes and faults for the text of a refusal, empty without any."""
        faults = (f"{f.kind.replace('_', ' ')}: {f.detail}" for f in self.faults)
        parts = dict.fromkeys([*self.notes, *faults])
        return f" ({'; '.join(parts)})" if parts else ""


NAME = "rsea"
NOTES, FAULTS = "rsea_notes", "rsea_faults"
KEPT = frozenset({"rows_left_out", "missing_values", "coarse_stamps", "raw_codes"})
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


def remarks_of(texts: object) -> Remarks:
    """Return this project's remarks among texts by name; none of anything else."""
    found = map(texts.get, (NOTES, FAULTS)) if isinstance(texts, Mapping) else ("", "")
    notes, faults = (text if isinstance(text, str) else "" for text in found)
    lines = [brief(line, _LONGEST) for line in notes.splitlines()[:_MOST] if "\0" not in line]
    return Remarks(lines, _faults(faults))


def _faults(text: str) -> list[Fault]:
    """Return the faults of rows [kind, channel, share, detail]; of anything else none."""
    try:
        rows = json.loads(text) if text else []
    except (ValueError, RecursionError):
        return []
    faults = []
    for row in rows[:_MOST] if isinstance(rows, list) else ():
        match row:
            case [str(kind), str(channel), float() | int() as share, str(detail)] if kind in KEPT:
                whole = float(share if 0.0 <= share <= 1.0 else math.nan)
                faults.append(Fault(kind, brief(channel, _LONGEST), whole, brief(detail, _LONGEST)))
    return faults
