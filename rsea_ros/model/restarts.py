"""Gaps of a whole record, or of its commands: after one, its simulation begins anew with the measured state.

What was commanded meanwhile is unknown. A sensor that pauses while others go on is no such gap. Nor are
commands that pause, which hold until the next one, unless the measured motor torque shows that others acted.
"""

from __future__ import annotations

import numpy as np

from rsea_ros.model.measured_motion import state_at
from rsea_ros.signals import BoolArray, Channel, FloatArray, IntArray, Record

SHORTEST, PERIODS = 0.1, 10.0
"""s, and sample periods of the fastest channel: a shorter gap leaves the last command a good guess."""

AT_EDGE = 0.01
"""Of a command's period: stamps so near are one, rounded to nanoseconds in one of two channels."""
_LOST = 3.0
"""Times what the motor torque is off the commands elsewhere: in a pause that is further off others acted."""

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
    lost = _lost_commands(record)
    return sorted([*whole, *(p for p in lost if not any(a < p[1] and b > p[0] for a, b in whole))])


def _lost_commands(record: Record) -> list[tuple[float, float]]:
    """Return begin and end (s) of the pauses of the commands in which the motor did not hold the last one."""
    command, torque = record.channels.get("command"), record.channels.get("motor_torque")
    if command is None or torque is None or len(command) < 3 or not np.all(np.diff(command.t) > 0.0):
        return []
    pauses = np.flatnonzero(np.diff(command.t) > max(SHORTEST, PERIODS / command.rate))
    if not len(pauses) or not np.isfinite(torque.y).any():
        return []
    hold = _shown_commands(command, torque)
    off = np.square(torque.y - command.y[hold])
    known, paused = np.isfinite(off), np.isin(hold, pauses)
    if not (known & ~paused).any():
        return []
    usual = float(np.mean(off[known & ~paused]))
    within = [off[known & (hold == k)] for k in pauses]
    lost = [k for k, o in zip(pauses, within, strict=True) if len(o) and np.mean(o) > _LOST**2 * usual]
    return [(float(command.t[k]), float(command.t[k + 1])) for k in lost]


def _shown_commands(command: Channel, torque: Channel) -> IntArray:
    """Return the number of the command that each motor torque shows: the one at its stamp, or before it."""
    edge = AT_EDGE / command.rate
    ended, begun = (np.searchsorted(command.t, torque.t + side * edge) - 1 for side in (-1.0, 1.0))
    either = [np.maximum(k, 0) for k in (ended, begun)]
    return np.asarray(min(either, key=lambda k: np.nanmedian(np.abs(torque.y - command.y[k]))), np.int64)


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
