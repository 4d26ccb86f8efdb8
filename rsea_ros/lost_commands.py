"""Commands that a log has lost: the motor torque shows others while they pause."""

from __future__ import annotations

import numpy as np

from rsea_ros.signals import Channel, IntArray, Record

SHORTEST, PERIODS = 0.1, 10.0
"""s, and sample periods of the fastest channel: a shorter gap leaves the last command a good guess."""

AT_EDGE = 0.01
"""Of a command's period: stamps so near are one, rounded to nanoseconds in one of two channels."""
_LOST = 3.0
"""Times what the motor torque is off the commands elsewhere: in a pause that is further off others acted."""


def lost_commands(record: Record) -> list[tuple[float, float]]:
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
