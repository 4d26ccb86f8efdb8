"""On which side of a new command the motor torque was read, where both have one stamp.

A command takes effect at its stamp and holds. A torque that is read at that instant is, by convention, of the
command that just ended; a log that commands first and then reads holds the one that just began. Under white
commands the other one is wrong by all of its size, so the data decide; a torque of the commands that begin
moves into the time in which they hold.
"""

from __future__ import annotations

import numpy as np

from rsea_ros.signals import Channel, Fault, FloatArray, Record

NEAR = 0.25
"""Of the shorter period: a torque so close to the stamp of a command is read at its edge."""
INSIDE = 0.6
"""Of a command period: how far such a torque moves, past any step of a simulation that ends at the edge."""
_FEWEST = 64
"""Samples at edges, to decide."""
_BETTER = 0.8
"""Of the residual under the command that ended, which that under the command that began must not exceed."""


def behind_the_edge(record: Record) -> tuple[Record, list[Fault]]:
    """Return the record with a motor torque of the commands that begin at its stamps read after their edges.

    A joint in its position loop has no commanded torque, and is returned as it is.
    """
    if not {"command", "motor_torque"} <= set(record.channels) or "reference" in record:
        return record, []
    command, torque = record["command"], record["motor_torque"]
    if len(command) < _FEWEST or len(torque) < _FEWEST or not _began(command, torque):
        return record, []
    late = min(INSIDE * _period(command), _period(torque))
    fault = Fault("early_torque", "motor_torque", 1.0, "each value is of the command with its stamp")
    return record.with_channels(motor_torque=Channel(torque.t + late, torque.y)), [fault]


def _began(command: Channel, torque: Channel) -> bool:
    """Return whether the torque at the edges of commands is that of the commands that begin there."""
    middle = 0.5 * (command.t[1:] + command.t[:-1])
    begun = np.searchsorted(middle, torque.t)
    near = NEAR * min(_period(command), _period(torque))
    at_edge = (np.abs(torque.t - command.t[begun]) < near) & (begun > 0)
    ended = np.maximum(begun - 1, 0)
    at_edge &= np.isfinite(torque.y) & np.isfinite(command.y[begun]) & np.isfinite(command.y[ended])
    if np.count_nonzero(at_edge) < _FEWEST:
        return False
    y, began, was = torque.y[at_edge], command.y[begun[at_edge]], command.y[ended[at_edge]]
    return _rms_left(_scale(y), _scale(began)) < _BETTER * _rms_left(_scale(y), _scale(was))


def _period(channel: Channel) -> float:
    """Return the usual time between two samples, s."""
    return float(np.median(np.diff(channel.t)))


def _scale(values: FloatArray) -> FloatArray:
    """Return values over the largest of them, so that no square overflows."""
    return np.asarray(values / (np.max(np.abs(values)) or 1.0))


def _rms_left(y: FloatArray, u: FloatArray) -> float:
    """Return the RMS that a constant and a gain on the command leave of a torque, in the torque's unit."""
    y, u = y - y.mean(), u - u.mean()
    power = float(u @ u)
    return float(np.sqrt(np.mean((y - (float(u @ y) / power if power else 0.0) * u) ** 2)))
