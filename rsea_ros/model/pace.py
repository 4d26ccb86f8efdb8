"""Whether the stamps of a record are in seconds: no loop that controls a joint is so slow, or so fast."""

from __future__ import annotations

import math

from rsea_ros.errors import IdentificationError
from rsea_ros.records.record import Record

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
    if is_slow(record) and _span(record) > LONGEST_SLOW:
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
