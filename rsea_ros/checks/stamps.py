"""Faults of the stamps: samples dropped, stamps doubled, a clock that jumped. Repaired where they can be."""

from __future__ import annotations

import numpy as np

from rsea_ros.signals import Channel, Fault, FloatArray, Record

_GAP = 1.6
"""In sample periods: a longer interval is a gap."""


def repair_clock(record: Record) -> tuple[Record, list[Fault]]:
    """Return the record with rising stamps, and what was wrong with them."""
    faults: list[Fault] = []
    channels = {}
    for name, channel in record.channels.items():
        channel, found = _without_jumps(channel, name, _expected_span(record, name))
        faults += found
        repeated = np.concatenate([[False], np.diff(channel.t) <= 0.0])
        if repeated.any():
            faults.append(Fault("duplicate_stamps", name, float(repeated.mean())))
            channel = Channel(channel.t[~repeated], channel.y[~repeated])
        faults += _dropped(channel, name, int(repeated.sum()))
        channels[name] = channel
    return record.with_channels(**channels), faults


def _expected_span(record: Record, name: str) -> float:
    """Return how long the other channels last, s: a clock that jumped makes one channel longer or shorter."""
    others = [float(c.t[-1] - c.t[0]) for n, c in record.channels.items() if n != name and len(c) > 1]
    return float(np.median(others)) if others else 0.0


def _without_jumps(channel: Channel, name: str, expected: float) -> tuple[Channel, list[Fault]]:
    """Take out steps of the clock: intervals that go back, or make the channel longer than the others."""
    step = np.diff(channel.t)
    period = float(np.median(step))
    back = step < -0.5 * period
    surplus = float(channel.t[-1] - channel.t[0]) - expected if expected else 0.0
    forward = np.zeros(len(step), bool)
    largest = int(np.argmax(step))
    if (
        expected
        and surplus > _GAP * period
        and step[largest] > _GAP * period
        and abs(step[largest] - period - surplus) < 2.0 * period
    ):
        forward[largest] = True
    at = back | forward
    if not at.any():
        return channel, []
    shift = np.concatenate([[0.0], np.cumsum(np.where(at, step - period, 0.0))])
    share = 1.0 - (int(np.argmax(at)) + 1) / len(channel.t)
    detail = f"{float(np.abs(shift).max()):.4g} s at {channel.t[int(np.argmax(at))]:.3f} s"
    return Channel(channel.t - shift, channel.y), [Fault("clock_jump", name, share, detail)]


def _dropped(channel: Channel, name: str, taken_out: int) -> list[Fault]:
    """Return the fault of missing samples. taken_out: how many had a stamp that was not theirs."""
    step = np.diff(channel.t)
    period = float(np.median(step))
    gaps = step > _GAP * period
    lost = float(np.sum(np.round(step[gaps] / period) - 1.0)) - taken_out
    if lost < 1.0:
        return []
    return [Fault("dropped_samples", name, lost / (len(channel) + lost))]


def gap_neighbours(t: FloatArray, reach: float) -> FloatArray:
    """Return which samples lie within `reach` s after a gap, where the command that acted is unknown."""
    step = np.diff(t)
    period = float(np.median(step))
    bad = np.zeros(len(t), bool)
    for k in np.flatnonzero(step > _GAP * period):
        bad |= (t >= t[k]) & (t <= t[k + 1] + reach)
    return bad
