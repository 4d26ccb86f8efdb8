"""Gaps of a whole record, or of its commands: after one, its simulation begins anew with the measured state.

What was commanded meanwhile is unknown. A sensor that pauses while others go on is no such gap. Nor are
commands that pause, which hold until the next one, unless the measured motor torque shows that others acted.
"""

from __future__ import annotations

import numpy as np

from rsea_ros.model.measured_motion import state_at
from rsea_ros.records.holds import PERIODS, SHORTEST, lost_commands
from rsea_ros.records.record import BoolArray, FloatArray, Record

Restart = tuple[int, tuple[float, float]]
"""Step of a drive before which it begins anew, and position (rad) and velocity (rad/s) there."""


def gaps(record: Record) -> list[tuple[float, float]]:
    """Return begin and end (s) of the gaps without a sample of any channel, or with lost commands, in order.

    Stamps need not rise.
    """
    stamps = [c.t[np.isfinite(c.t)] for c in record.channels.values() if len(c) > 1]
    if not stamps:
        return []
    t = np.sort(np.concatenate(stamps))
    fastest = max(c.rate for c in record.channels.values() if len(c) > 1)
    at = np.flatnonzero(np.diff(t) > max(SHORTEST, PERIODS / fastest if fastest > 0.0 else np.inf))
    whole = [(float(t[k]), float(t[k + 1])) for k in at]
    lost = lost_commands(record)
    return sorted([*whole, *(p for p in lost if not any(a < p[1] and b > p[0] for a, b in whole))])


def restarts(record: Record, start: float, step: float, *, from_rest: bool) -> tuple[Restart, ...]:
    """Return where a drive begins anew. start: s, of its first step; from_rest: it began at angle zero."""
    states = []
    for _, end in gaps(record):
        k = int(np.ceil((end - start) / step))
        position, velocity = state_at(record, end, start + k * step)
        states.append((k, (position - state_at(record, start, start)[0] * from_rest, velocity)))
    return tuple(states)


def outside_gaps(record: Record, t: FloatArray, settling: float) -> BoolArray:
    """Return which times lie in no gap and not within `settling` (s) behind one, shape (n,)."""
    outside = np.ones(len(t), bool)
    for begin, end in gaps(record):
        outside &= (t <= begin) | (t >= end + settling)
    return outside
