"""Commands that are published only when they change, always or at times: each holds until the next one.

A log of such a publisher has one message for each step, which may last for seconds, or pauses between spans
at the rate of a loop. What reads a record expects the commands of a control loop, one for each of its cycles.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rsea_ros.lost_commands import lost_commands
from rsea_ros.signals import MEASURED, BoolArray, Channel, Fault, FloatArray, Record

COMMANDS = ("command", "reference")

_LONG = 32.0
"""Sample periods of the sensors that a value lasts, at the median: a step, no sample of a signal (a loop at
20 Hz beside sensors at 500 Hz is none)."""
_FEWEST = 2
_THROUGHOUT = 0.25
"""Of a pause: without a sample for no longer than that, a sensor shows that the recorder went on."""


def with_held_commands(record: Record) -> tuple[Record, list[Fault]]:
    """Return the record with a command in each sample period of its sensors, where each command is a step.

    In a pause of the commands alone, the last one is repeated at their usual rate. A note says so; no fault
    comes with it. The stamps of the steps are kept exactly, and the last one is held to the end of the
    sensors.
    """
    held = _held_steps(record)
    if not held:
        return record, []
    commands = {name: _hold_commands(record, name, steps) for name, steps in held.items()}
    notes = (f"{name}: {_words(record[name], steps)}" for name, steps in held.items())
    return replace(record.with_channels(**commands), notes=(*record.notes, *notes)), []


def words_on_steps(record: Record) -> dict[str, str]:
    """Return, for each channel of commands that are steps, how it is read."""
    return {name: _words(record[name], steps) for name, steps in _held_steps(record).items()}


def _words(channel: Channel, held: BoolArray) -> str:
    if held.all():
        return f"{len(channel)} messages, one for each change; each value is held until the next"
    lasts = np.where(held, np.diff(channel.t), 0.0)
    longest, count = int(np.argmax(lasts)), np.count_nonzero(held)
    return (
        f"{count} {'pauses' if count > 1 else 'pause'} of the commands alone, the longest "
        f"{lasts[longest]:.3g} s at {channel.t[longest]:.4g} s; the last value is held"
    )


def _held_steps(record: Record) -> dict[str, BoolArray]:
    """Return which steps to the next command a value is held over, shape (n - 1,), of channels with any."""
    held = {}
    for name in COMMANDS:
        if name in record:
            is_steps = _is_steps(record[name], _sensor_period(record))
            held[name] = np.ones(len(record[name]) - 1, np.bool_) if is_steps else paused_steps(record, name)
    return {name: steps for name, steps in held.items() if steps.any()}


def paused_steps(record: Record, name: str) -> BoolArray:
    """Return which steps between commands are pauses of their publisher, shape (n - 1,).

    A pause lasts for many of the commands' usual steps and of the sensors' sample periods, while a sensor
    goes on: the recorder lost nothing. Commands of a log that stops as a whole are lost, and those in whose
    place the motor torque shows others.
    """
    channel = record[name]
    step = np.diff(channel.t)
    if len(step) < _FEWEST or not np.isfinite(channel.y).all() or np.any(step <= 0.0):
        return np.zeros(len(step), np.bool_)
    usual = max(_sensor_period(record), float(np.median(step)))
    pauses: BoolArray = step >= _LONG * usual
    sensors = [record[n].t for n in MEASURED if n in record]
    for k in np.flatnonzero(pauses):
        pauses[k] = any(_goes_on(t, float(channel.t[k]), float(channel.t[k + 1])) for t in sensors)
    if name == "command" and pauses.any():
        pauses &= ~np.isin(channel.t[:-1], [begin for begin, _ in lost_commands(record)])
    return pauses


def _goes_on(t: FloatArray, start: float, stop: float) -> bool:
    """Return whether stamps lie all over a span, s."""
    inside = t[(t > start) & (t < stop)]
    return float(np.max(np.diff(inside, prepend=start, append=stop))) <= _THROUGHOUT * (stop - start)


def _hold_commands(record: Record, name: str, held: BoolArray) -> Channel:
    """Return a channel of commands with the values of its held steps repeated; steps alone to the end."""
    channel, last = record[name], float(record[name].t[-1])
    is_steps = bool(held.all())
    period = _sensor_period(record) if is_steps else float(np.median(np.diff(channel.t)))
    end = max(float(c.t[-1]) for c in record.channels.values() if len(c)) if is_steps else last
    return _repeat_values(channel, np.append(channel.t[1:], end), period, np.append(held, is_steps))


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


def _repeat_values(channel: Channel, ends: FloatArray, period: float, which: BoolArray) -> Channel:
    """Return the channel with some samples repeated evenly until their ends, s. period: of the repeats, s."""
    lasts: FloatArray = ends - channel.t
    counts = np.where(which, np.maximum(1, np.rint(lasts / period)), 1).astype(np.int64)
    place = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    t = np.repeat(channel.t, counts) + place * np.repeat(lasts / counts, counts)
    return Channel(t, np.repeat(channel.y, counts))
