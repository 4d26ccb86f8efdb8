"""RDT: requests, records of 36 bytes, and what their counters tell of records that are gone."""

from __future__ import annotations

import struct
from collections import Counter
from typing import NamedTuple

STOP, STREAM, RESET_LATCH, SET_BIAS = 0, 2, 0x41, 0x42
SIZE = 36
_RECORD = struct.Struct(">III6i")
_REQUEST = struct.Struct(">HHI")
_WORD = 1 << 32
ERROR = 0x8000_0000
SATURATION = 0x0002_0000
LATCHED = 0x8001_0000
LONGEST_GAP = 1 << 20
"""Records; a larger step forward is damage, not a gap (150 s at 7 kHz)."""
REORDERED = 64
"""Records; so far back is a datagram that was overtaken, further back another stream."""
RESYNCHRONISE = 4
"""Consecutive records that are believed against those before."""


class Record(NamedTuple):
    """One record: counters, status bits, counts of force x, y, z and torque x, y, z."""

    sequence: int
    ft_sequence: int
    status: int
    counts: tuple[int, ...]


def request(command: int, count: int = 0) -> bytes:
    """Return a request; count: records that are wanted, 0 for ever."""
    return _REQUEST.pack(0x1234, command, count)


def decode(datagram: bytes) -> Record | None:
    """Return the record of a datagram; None for one that is none."""
    if len(datagram) != SIZE:
        return None
    sequence, ft_sequence, status, *counts = _RECORD.unpack(datagram)
    return Record(sequence, ft_sequence, status, tuple(counts))


def trouble(status: int) -> str:
    """Return what status bits complain of: '' nothing, `saturation` or `status`.

    0x80010000 alone is the condition latch, a memory of an old crossing and no error.
    """
    if status & SATURATION:
        return "saturation"
    return "status" if status & ERROR and status != LATCHED else ""


class Sequence:
    """Follows the counters of one stream.

    counts: `received`, `lost`, `duplicate`, `reordered`, `damaged` (a step that no stream makes), `frozen`
    (the sensor's own counter stands still), `restarted` (it went back: the sensor was switched off),
    `resynchronised` (records that fit each other, not those before: they are another stream).
    """

    def __init__(self) -> None:
        self.counts: Counter[str] = Counter()
        self._rdt: int | None = None
        self._ft: int | None = None
        self._stray: int | None = None
        self._strays = 0

    def begin(self) -> None:
        """A new stream was asked for: rdt_sequence begins anew, the sensor's own counter goes on."""
        self._rdt = None

    def forget(self) -> None:
        """Take whatever comes next for good."""
        self._rdt = self._ft = None

    def accept(self, record: Record) -> bool:
        """Count a record; tell whether it is newer than all before and may be used."""
        step = 1 if self._rdt is None else (record.sequence - self._rdt) % _WORD
        kind = _kind(step)
        if kind and self._another_stream(record):
            self.counts["resynchronised"] += 1
            step, kind = 1, ""
        ft_step = 1 if self._ft is None else (record.ft_sequence - self._ft) % _WORD
        if not kind and ft_step >= LONGEST_GAP:
            if _WORD - ft_step <= REORDERED:
                kind = "reordered"
            else:
                self._restart(record)
                return False
        if kind:
            self.counts[kind] += 1
            return False
        self.counts["lost"] += step - 1
        self.counts["received"] += 1
        self.counts["frozen"] += ft_step == 0
        self._rdt, self._ft = record.sequence, record.ft_sequence
        self._stray, self._strays = None, 0
        return True

    def _another_stream(self, record: Record) -> bool:
        """Tell whether the last few records that did not fit follow each other."""
        follows = self._stray is not None and record.sequence == (self._stray + 1) % _WORD
        self._strays = self._strays + 1 if follows else 1
        self._stray = record.sequence
        return self._strays >= RESYNCHRONISE

    def _restart(self, record: Record) -> None:
        """Follow a counter that begins anew at about zero; take any other jump for damage."""
        back = record.ft_sequence < LONGEST_GAP
        self.counts["restarted" if back else "damaged"] += 1
        if back:
            self._rdt, self._ft = record.sequence, record.ft_sequence


def _kind(step: int) -> str:
    """Return what is wrong with a step of rdt_sequence; '' for the next record, also after a gap."""
    if step == 0:
        return "duplicate"
    if step < LONGEST_GAP:
        return ""
    return "reordered" if _WORD - step <= REORDERED else "damaged"
