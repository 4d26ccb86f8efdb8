"""Where a simulation starts anew: behind gaps, and on the measured motion.

What was commanded meanwhile is unknown. A sensor that pauses while others go on is no such gap. Nor are
commands that pause, which hold until the next one, unless the measured motor torque shows that others acted.
"""

from __future__ import annotations

import numpy as np

from rsea_ros.model.rig import Rig
from rsea_ros.records.holds import PERIODS, SHORTEST, lost_commands
from rsea_ros.records.record import BoolArray, FloatArray, Record

AT_REST = 0.5
"""Of the whole record's standard deviation: a first sample below it is of a bench that started from rest."""

LATE = 1.6
"""Sample periods: a first sample later than this after the first command is of a channel that starts late."""


def zero_unknown(record: Record, rig: Rig, channel: str) -> bool:
    """Return whether only the changes of a channel count: by the rig, or for a position that is far off."""
    off = any((f.kind, f.channel) == ("offset", "position") for f in record.faults)
    return rig.zero_unknown(channel) or (channel == "position" and off)


def first_state(record: Record) -> tuple[float, float]:
    """Return the first position and velocity, zero where there is none."""
    position, velocity = (_finite(record, n)[1] for n in ("position", "velocity"))
    return float(position[0]), float(velocity[0])


def initial_state(record: Record) -> tuple[float, float]:
    """Return position and velocity at the start: rest, unless the first samples say otherwise.

    The first sample comes a period after the first command; a motion that the command may have caused until
    then, the largest change from sample to sample, is not an initial motion. A channel that was not measured
    says nothing. The position at the start is the first one less what the first velocity brought until then.
    """
    (t, position), (_, velocity) = (_finite(record, n) for n in ("position", "velocity"))
    if not (_has_moved(position) or _has_moved(velocity)):
        return 0.0, 0.0
    late = float(t[0] - record["command"].t[0])
    passed = late if "position" in record and 0.0 < late < LATE * float(t[1] - t[0]) else 0.0
    return float(position[0] - passed * velocity[0]), float(velocity[0])


def state_at(record: Record, first: float, at: float) -> tuple[float, float]:
    """Return position and velocity at a time (s), from the first samples at or after `first` (s).

    Zero where there is none; a velocity that is not measured is the slope of the position.
    """
    position, velocity = (_from(record, n, first) for n in ("position", "velocity"))
    if velocity is not None:
        v = float(velocity[1][0])
    else:
        v = float(np.diff(position[1][:2])[0] / np.diff(position[0][:2])[0]) if position is not None else 0.0
    return (0.0 if position is None else float(position[1][0] + v * (at - position[0][0]))), v


def _from(record: Record, name: str, first: float) -> tuple[FloatArray, FloatArray] | None:
    """Return stamps and finite values of a channel from a time (s) on, None where fewer than two are left."""
    if name not in record:
        return None
    t, y = record[name].t, record[name].y
    keep = (t >= first) & np.isfinite(y)
    return (t[keep], y[keep]) if np.count_nonzero(keep) > 1 else None


def angle_at(record: Record, ends: FloatArray) -> FloatArray:
    """Return the measured position at some times (s), by cubics where its speed is measured with it."""
    if "position" not in record:
        return np.empty(0)
    t, q = _finite(record, "position")
    if "velocity" in record and len(t) > 1:
        at, v = _finite(record, "velocity")
        if np.array_equal(at, t):
            return _cubics(t, q, v, np.clip(ends, t[0], t[-1]))
    return np.interp(ends, t, q)


def _finite(record: Record, name: str) -> tuple[FloatArray, FloatArray]:
    """Return stamps and values of a channel where it has values; a rest of two samples where it has none."""
    if name in record:
        t, y = record[name].t, record[name].y
        good = np.isfinite(y)
        if np.count_nonzero(good) > 1:
            return t[good], y[good]
    return np.arange(2.0), np.zeros(2)


def _cubics(t: FloatArray, y: FloatArray, slope: FloatArray, at: FloatArray) -> FloatArray:
    """Return at some times within t the cubics through y that have its slope there (Hermite)."""
    k = np.clip(np.searchsorted(t, at, side="right") - 1, 0, len(t) - 2)
    width = t[k + 1] - t[k]
    u = (at - t[k]) / width
    left, right = u * (1.0 - u) ** 2 * width * slope[k], u**2 * (u - 1.0) * width * slope[k + 1]
    return np.asarray(y[k] + (y[k + 1] - y[k]) * u**2 * (3.0 - 2.0 * u) + left + right)


def _has_moved(y: FloatArray) -> bool:
    least = max(AT_REST * np.std(y), np.max(np.abs(np.diff(y))))
    return bool(y[0] != 0.0 and abs(y[0]) >= least)


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
