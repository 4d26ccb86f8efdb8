"""Commands that are published only when they change: each holds until the next one.

A log of such a publisher has one message for each step, which may last for seconds. What reads a record
expects the commands of a control loop, one for each of its cycles.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rsea_ros.signals import MEASURED, Channel, Fault, FloatArray, Record

_LONG = 32.0
"""Sample periods of the sensors that a value lasts, at the median: a step, no sample of a signal (a loop at
20 Hz beside sensors at 500 Hz is none)."""
_FEWEST = 2


def with_held_commands(record: Record) -> tuple[Record, list[Fault]]:
    """Return the record with a command in each sample period of its sensors, where each command is a step.

    A note says so; no fault comes with it. The stamps of the steps are kept exactly, and the last one is held
    to the end of the sensors.
    """
    words = words_on_steps(record)
    if not words:
        return record, []
    period = _sensor_period(record)
    last = max(float(c.t[-1]) for c in record.channels.values() if len(c))
    held = {name: _repeat_values(record[name], period, last) for name in words}
    notes = (f"{name}: {sentence}" for name, sentence in words.items())
    return replace(record.with_channels(**held), notes=(*record.notes, *notes)), []


def words_on_steps(record: Record) -> dict[str, str]:
    """Return, for each channel of commands that are steps, how it is read."""
    period = _sensor_period(record)
    commands = {name: record[name] for name in ("command", "reference") if name in record}
    return {
        name: f"{len(channel)} messages, one for each change; each value is held until the next"
        for name, channel in commands.items()
        if _is_steps(channel, period)
    }


def _sensor_period(record: Record) -> float:
    """Return the shortest usual time between two samples of a sensor, s; infinite without one."""
    channels = (record[name] for name in MEASURED if name in record and len(record[name]) > _FEWEST)
    periods = [float(np.median(np.diff(channel.t))) for channel in channels]
    return min((p for p in periods if p > 0.0), default=np.inf)


def _is_steps(channel: Channel, period: float) -> bool:
    """Return whether every message is a change and most values last long. period: of the sensors, s."""
    if len(channel) < _FEWEST or not np.isfinite(channel.y).all() or np.any(np.diff(channel.t) <= 0.0):
        return False
    changes = bool(np.all(channel.y[1:] != channel.y[:-1]))
    return changes and float(np.median(np.diff(channel.t))) >= _LONG * period


def _repeat_values(channel: Channel, period: float, last: float) -> Channel:
    """Return the channel with each step repeated evenly until the next, the last one until `last`, s."""
    ends = np.append(channel.t[1:], max(last, float(channel.t[-1])))
    lasts: FloatArray = ends - channel.t
    counts = np.maximum(1, np.rint(lasts / period)).astype(np.int64)
    place = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    t = np.repeat(channel.t, counts) + place * np.repeat(lasts / counts, counts)
    return Channel(t, np.repeat(channel.y, counts))
