"""Sensors slower than the log, which repeats each value until the next one arrives."""

from __future__ import annotations

import numpy as np

from rsea_ros.signals import SENSED, BoolArray, Channel, Fault, FloatArray, Record

_FEWEST_VALUES = 32
"""Fewer say nothing of how often they come."""
_REPEATED, _REGULAR = 3.0, 1.6
"""Samples that a value lasts, at least, and times as long that nine of ten last at most."""
_MANY_STEPS = 4.0
"""Times the smallest step: a sensor that goes on by one step or two is coarse, not slow."""


def without_held_samples(record: Record) -> tuple[Record, list[Fault]]:
    """Return the record with the first sample of each value alone, where a sensor's log repeats it; faults.

    A repeat is no measurement at its stamp: a fit takes it for a sensor that comes late.
    """
    arrived, faults = {}, []
    for name in SENSED:
        repeats = repeats_of(record[name].y) if name in record else 1
        if repeats > 1:
            arrived[name] = _arrivals(record[name])
            share = 1.0 - len(arrived[name]) / len(record[name])
            detail = f"the log repeats every value {repeats} times; the first of each is used"
            faults.append(Fault("held_samples", name, share, detail, record[name].rate / repeats, "Hz"))
    return record.with_channels(**arrived), faults


def repeats_of(values: FloatArray) -> int:
    """Return in how many samples in a row a value arrives, 1 where each is a reading of its own.

    A coarse sensor repeats values too, but as long as the motion has it, and then goes on by a step or two.
    """
    new = np.flatnonzero(_is_new(values))
    if len(new) < _FEWEST_VALUES or not np.isfinite(values).all():
        return 1
    usual, long = np.quantile(np.diff(new), (0.5, 0.9))
    steps = np.abs(np.diff(values[new] / np.max(np.abs(values))))
    regular = usual >= _REPEATED and long < _REGULAR * usual
    return int(usual) if regular and np.median(steps) > _MANY_STEPS * steps.min() else 1


def _arrivals(channel: Channel) -> Channel:
    """Return the samples that differ from the one before; all that lack a value, which a check reports."""
    new = _is_new(channel.y)
    return Channel(channel.t[new], channel.y[new])


def _is_new(values: FloatArray) -> BoolArray:
    """Return which samples differ from the one before."""
    return np.concatenate([[True], values[1:] != values[:-1]])
