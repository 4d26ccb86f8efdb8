"""Extent and pace of a machine: how far and how fast it moves."""

import math

import numpy as np

from rsea_ros.errors import IdentificationError
from rsea_ros.records.record import Channel, Record

LARGEST = 1e30
"""In any unit: a larger number is not a measurement, and squares and sums of it overflow."""
SMALLEST = 1e-30
"""In any unit: smaller is not a measurement either but zero; squares of it underflow."""
LONGEST_PAUSE = 60.0
"""s without samples that are simulated through, whatever the length of the record."""
MOST_EMPTY = 2.0
"""Of the time that the samples cover: a longer pause is cheaper to cut out than to simulate through."""


def check_extent(record: Record, start: float, stop: float) -> None:
    """Raise IdentificationError where a grid from start to stop (s) is far longer than a record's samples.

    A clock that was set during the recording, or a pause of hours, would need millions of empty steps.
    """
    stamps = (c.t for c in record.channels.values() if stop - start > LONGEST_PAUSE)  # else it is not needed
    covered = max((len(t) * float(np.median(np.diff(t))) for t in stamps if len(t) > 1), default=0.0)
    if stop - start <= LONGEST_PAUSE + (1.0 + MOST_EMPTY) * covered:
        return
    pauses = [(n, int(np.argmax(np.diff(c.t))), c.t) for n, c in record.channels.items() if len(c) > 1]
    name, k, t = max(pauses, key=lambda p: float(np.max(np.diff(p[2]))))
    pause = f", {name} pauses for {t[k + 1] - t[k]:.4g} s after {t[k]:.4g} s"
    raise IdentificationError(
        f"{record.source}: {covered:.4g} s of samples within {stop - start:.4g} s"
        f"{pause if t[k + 1] - t[k] > 0.2 * (stop - start) else ', not all channels at the same time'}: "
        "did the clock jump? Cut the bag there, or record again with one clock for all topics"
    )


def bound_values(record: Record) -> Record:
    """Return the record with NaN for values beyond LARGEST, and zero for values below SMALLEST."""
    return record.with_channels(**{n: _bound_channel(c) for n, c in record.channels.items()})


def _bound_channel(channel: Channel) -> Channel:
    size = np.abs(channel.y)
    good = (size <= LARGEST) & ((size >= SMALLEST) | (size == 0.0))
    if good.all():
        return channel
    return Channel(channel.t, np.where(good, channel.y, np.where(size < SMALLEST, 0.0, np.nan)))


def check_command(record: Record) -> None:
    """Raise IdentificationError for a command that no simulation can be driven with: NaN, or not rising."""
    command = record["command"]
    bad = ~np.isfinite(command.y)
    back = np.diff(command.t, prepend=-np.inf) <= 0.0
    for k in np.flatnonzero(bad | back)[:1]:
        value = (
            f"{command.y[k]} N·m"
            if bad[k]
            else f"stamped {command.t[k]:.6g} s after {command.t[k - 1]:.6g} s"
        )
        expected = f"a number up to {LARGEST:g}" if bad[k] else "rising stamps"
        raise IdentificationError(f"{record.source}: command[{k}] is {value}, expected {expected}")


SLOW, LONGEST_SLOW = 4.0, 900.0
"""Hz of the fastest channel below which a record is slow, and s of the longest slow record: stamps in ms make
of 10 s at 280 Hz a record of three hours, of which every simulation would last for minutes."""
FAST = 5e4
"""Hz of the slowest channel: no loop that controls a joint, and no recorder of one, is faster."""
SKIPPED_START = 0.3
"""s at the start of a record that no comparison or fit uses, because the bench may not have been at rest."""
AS_SECONDS = "are the stamps in s, not in ms or µs?"


def check_pace(record: Record) -> None:
    """Raise IdentificationError for a record whose stamps are likely in another unit than seconds."""
    check_slow(record)
    if is_too_fast(record):
        lasts = f"lasts {_span(record):.4g} s at {min(_rates(record)):.3g} Hz"
        expected = f"more than {SKIPPED_START:g} s at up to {FAST:g} Hz"
        raise IdentificationError(f"{record.source}: {lasts}, expected {expected}: {AS_SECONDS}")


def check_slow(record: Record) -> None:
    """Raise IdentificationError for a record that lasts far too long for its rates."""
    if _span(record) > LONGEST_SLOW and is_slow(record):
        lasts, rate = f"{record.source}: lasts {_span(record):.4g} s", f"{max(_rates(record)):.3g} Hz"
        raise IdentificationError(
            f"{lasts}, expected up to {LONGEST_SLOW:g} s at {rate}: {AS_SECONDS} If so, cut the record"
        )


def is_slow(record: Record) -> bool:
    """Return whether no channel has the rate of a control loop."""
    rates = _rates(record)
    return bool(rates) and max(rates) <= SLOW


def is_too_fast(record: Record) -> bool:
    """Return whether a record ends before any sample counts, or all channels are faster than any loop."""
    rates = _rates(record)
    return bool(rates) and (_span(record) <= SKIPPED_START or min(rates) > FAST)


def _rates(record: Record) -> list[float]:
    """Return the rate of every channel that has one, Hz."""
    return [c.rate for c in record.channels.values() if len(c) > 2 and math.isfinite(c.rate)]


def _span(record: Record) -> float:
    """Return how long a record lasts, s; 0 for one without samples."""
    filled = [c for c in record.channels.values() if len(c)]
    return max(float(c.t[-1]) for c in filled) - min(float(c.t[0]) for c in filled) if filled else 0.0
