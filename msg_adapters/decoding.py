"""Messages of one topic to stamps and columns, and which of them hold what."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from msg_adapters.cdr import Block, blocks
from msg_adapters.contents import Contents, Messages
from rsea_ros.records.record import BoolArray, FloatArray, IntArray

_SECOND = 1_000_000_000
_PADDING = 4
"""Bytes behind a message that the middleware may add, less one."""


class Decoded:
    """Stamps (ns) and values by field, each (n,), with which messages fill the field.

    sound: messages that could be decoded.
    """

    def __init__(self, messages: Messages, msgtype: str, fields: tuple[str, ...]) -> None:
        count = len(messages.raw)
        self._messages, self._msgtype, self.fields = messages, msgtype, fields
        self.stamps: IntArray = np.zeros(count, np.int64)
        self.sound: BoolArray = np.zeros(count, bool)
        self.values: dict[str, FloatArray] = {field: np.full(count, np.nan) for field in fields}
        self.filled: dict[str, BoolArray] = {field: np.zeros(count, bool) for field in fields}

    def blocks(self, topic: str, where: str, report: Contents) -> list[Block]:
        """Return the messages by layout, without the damaged ones, which are reported.

        Raises BagError where all are damaged.
        """
        damaged: dict[int, str] = {}
        sorted_blocks = list(blocks(self._messages.raw, self._msgtype, where, damaged))
        _mark_overlong(sorted_blocks, damaged)
        for block in sorted_blocks:
            self.stamps[block.rows] = block.stamps()
            for row in block.rows[block.nanoseconds() >= _SECOND].tolist():
                damaged.setdefault(row, "its stamp has more than a second of nanoseconds")
        if damaged:
            first, share = min(damaged), len(damaged) / len(self.stamps)
            detail = f"left out, the first is message {first}: {damaged[first]}"
            report.tell("damaged_messages", topic, detail, len(damaged), "messages", share)
        self.sound[:] = True
        self.sound[list(damaged)] = False
        return sorted_blocks

    def take(self, block: Block, columns: Mapping[str, FloatArray | None]) -> None:
        """Take the columns that a block of messages has."""
        sound = self.sound[block.rows]
        rows = block.rows[sound]
        for field, column in columns.items():
            if column is not None:
                self.values[field][rows] = column[sound]
                self.filled[field][rows] = True

    def tell_empty(self, topic: str, report: Contents) -> None:
        """Report a field that some messages leave empty although they have the other fields."""
        for field, filled in self.filled.items():
            beside = [
                other for name, other in self.filled.items() if name != field and (other & filled).any()
            ]
            lacking = np.zeros(len(filled), bool)
            for other in beside:
                lacking |= other & ~filled
            if count := int(lacking.sum()):
                detail = f"{field} is empty, first in message {int(np.argmax(lacking))}"
                report.tell("empty_fields", topic, detail, count, "messages", count / len(filled))


def _mark_overlong(blocks_of_topic: list[Block], damaged: dict[int, str]) -> None:
    """Mark messages that go on behind their last field, unless those of the topic all do."""
    surplus = [(block, block.matrix.shape[1] - block.layout.end) for block in blocks_of_topic]
    if all(count >= _PADDING for _, count in surplus):
        return
    for block, count in surplus:
        if count >= _PADDING:
            reason = f"{count} bytes behind its last field, expected none"
            damaged.update(dict.fromkeys(block.rows.tolist(), reason))
