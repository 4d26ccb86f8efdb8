"""RDT: requests, records of 36 bytes, and lost records by their counters."""

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


class RdtRecord(NamedTuple):
    """One record: counters, status bits, counts of force x, y, z and torque x, y, z."""

    sequence: int
    ft_sequence: int
    status: int
    counts: tuple[int, ...]


def request(command: int, count: int = 0) -> bytes:
    """Return a request; count: requested records, 0 without end."""
    return _REQUEST.pack(0x1234, command, count)


def decode(datagram: bytes) -> RdtRecord | None:
    """Return the record of a datagram; None for another datagram."""
    if len(datagram) != SIZE:
        return None
    sequence, ft_sequence, status, *counts = _RECORD.unpack(datagram)
    return RdtRecord(sequence, ft_sequence, status, tuple(counts))


def trouble(status: int) -> str:
    """Return the error in the status bits: '' none, `saturation` or `status`.

    0x80010000 alone is the condition latch, the memory of an earlier crossing, not an error.
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
        self._stray: tuple[int, int] | None = None
        self._strays = 0

    def begin(self) -> None:
        """A new stream was requested: rdt_sequence restarts, the sensor's own counter continues."""
        self._rdt = None

    def forget(self) -> None:
        """Accept the next record whatever its counters."""
        self._rdt = self._ft = None

    def accept(self, record: RdtRecord) -> bool:
        """Count a record; return whether it is newer than all before and may be used."""
        step = 1 if self._rdt is None else (record.sequence - self._rdt) % _WORD
        ft_step = 1 if self._ft is None else (record.ft_sequence - self._ft) % _WORD
        kind = _kind(step) or _ft_kind(ft_step, record.ft_sequence)
        if kind and kind != "restarted" and self._another_stream(record):
            self.counts["resynchronised"] += 1
            step, ft_step, kind = 1, 1, ""
        if kind:
            self.counts[kind] += 1
            if kind == "restarted":
                self._rdt, self._ft = record.sequence, record.ft_sequence
            return False
        self.counts["lost"] += step - 1
        self.counts["received"] += 1
        self.counts["frozen"] += ft_step == 0
        self._rdt, self._ft = record.sequence, record.ft_sequence
        self._stray, self._strays = None, 0
        return True

    def _another_stream(self, record: RdtRecord) -> bool:
        """Return whether the last few records that did not fit follow each other."""
        follows = False
        if self._stray is not None:
            step, ft_step = ((new - old) % _WORD for new, old in zip(record[:2], self._stray, strict=True))
            follows = step == 1 and ft_step < LONGEST_GAP
        self._strays = self._strays + 1 if follows else 1
        self._stray = (record.sequence, record.ft_sequence)
        return self._strays >= RESYNCHRONISE


def _ft_kind(step: int, counter: int) -> str:
    """Return the fault in a step of ft_sequence; '' for none, also after a gap.

    A counter that restarts near zero means a sensor that was off; any other jump is damage, until it
    continues.
    """
    if step < LONGEST_GAP:
        return ""
    if _WORD - step <= REORDERED:
        return "reordered"
    return "restarted" if counter < LONGEST_GAP else "damaged"


def _kind(step: int) -> str:
    """Return the fault in a step of rdt_sequence; '' for the next record, also after a gap."""
    if step == 0:
        return "duplicate"
    if step < LONGEST_GAP:
        return ""
    return "reordered" if _WORD - step <= REORDERED else "damaged"
