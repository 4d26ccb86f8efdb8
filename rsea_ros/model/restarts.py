"""Gaps of a whole record: after one, its simulation begins anew with the measured state.

What was commanded meanwhile is unknown. A channel that pauses while others go on is no such gap: a command
holds until the next one.
"""

from __future__ import annotations

import numpy as np

from rsea_ros.model.measured_motion import state_at
from rsea_ros.signals import BoolArray, FloatArray, Record

SHORTEST, PERIODS = 0.1, 10.0
"""s, and sample periods of the fastest channel: a shorter gap leaves the last command a good guess."""

Restart = tuple[int, tuple[float, float]]
"""Step of a drive before which it begins anew, and position (rad) and velocity (rad/s) there."""


def gaps(record: Record) -> list[tuple[float, float]]:
    """Return begin and end (s) of the gaps in which no channel has a sample; stamps need not rise."""
    stamps = [c.t[np.isfinite(c.t)] for c in record.channels.values() if len(c) > 1]
    if not stamps:
        return []
    t = np.sort(np.concatenate(stamps))
    fastest = max(c.rate for c in record.channels.values() if len(c) > 1)
    at = np.flatnonzero(np.diff(t) > max(SHORTEST, PERIODS / fastest if fastest > 0.0 else np.inf))
    return [(float(t[k]), float(t[k + 1])) for k in at]


def restarts(record: Record, start: float, step: float, *, from_rest: bool) -> tuple[Restart, ...]:
    """Return where a drive begins anew. start: s, of its first step; from_rest: it began at angle zero."""
    made = []
    for _, end in gaps(record):
        k = int(np.ceil((end - start) / step))
        position, velocity = state_at(record, end, start + k * step)
        made.append((k, (position - state_at(record, start, start)[0] * from_rest, velocity)))
    return tuple(made)


def outside_gaps(record: Record, t: FloatArray, settling: float) -> BoolArray:
    """Return which times lie in no gap and not within `settling` (s) behind one, shape (n,)."""
    outside = np.ones(len(t), bool)
    for begin, end in gaps(record):
        outside &= (t <= begin) | (t >= end + settling)
    return outside
