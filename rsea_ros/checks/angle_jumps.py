"""Finding about an angle that jumps from one sample to the next: wrapped at a turn, or counted anew."""

from __future__ import annotations

import math

import numpy as np

from rsea_ros.checks.finding import Finding
from rsea_ros.records.record import BoolArray, Channel, FloatArray, IntArray, Record

_LARGE = 10.0
"""Times the largest usual step: a motion has no step so much larger than those beside it."""
_USUAL = 0.99
"""Quantile of the steps: jumps are fewer than the rest of them."""
_CONTRADICTED = 0.2
"""Of a jump: what the measured velocity brings in that time where the machine did not make it."""
_TURN = 2.0 * math.pi
_NEAR_TURN = 0.05
"""Of a turn."""
_FEWEST = 64
"""Samples that show what steps are usual."""


def jump_findings(record: Record) -> list[Finding]:
    """Return a finding for each angle that jumps. record: finite values, rising stamps."""
    return [f for n in ("position", "deflection") if n in record for f in _of_angle(record, n)]


def _of_angle(record: Record, name: str) -> list[Finding]:
    channel = record[name]
    at = _jumps(channel)
    sizes = np.diff(channel.y)[at]
    turns = np.abs(np.abs(sizes) - _TURN) < _NEAR_TURN * _TURN
    made_up = turns | _is_contradicted(record, at, sizes) if name == "position" else turns
    if not made_up.any():
        return []
    first = int(np.argmax(made_up))
    wrapped = bool(turns[first])
    where = f"by {sizes[first]:.3g} rad at {channel.t[at[first] + 1]:.4g} s"
    return [
        Finding(
            "red",
            "angle_jumps",
            name,
            float(np.count_nonzero(made_up)),
            "1",
            expected="none",
            detail=f"{where}: {'a whole turn' if wrapped else 'the velocity did not make it'}",
            remedy='`expression: "unwrap(…)"` in the import map, or publish the angle unwrapped'
            if wrapped
            else "cut the record there with --from or --to: the encoder began to count anew",
        )
    ]


def _jumps(channel: Channel) -> IntArray:
    """Return before which jumps the samples stand: steps far larger than all beside them."""
    step = np.abs(np.diff(channel.y))
    if len(step) < _FEWEST:
        return np.empty(0, np.int64)
    usual = float(np.quantile(step, _USUAL))
    large = step > _LARGE * max(usual, 1e-12)
    alone = large & ~np.roll(large, 1) & ~np.roll(large, -1)
    return np.flatnonzero(alone)


def _is_contradicted(record: Record, at: IntArray, sizes: FloatArray) -> BoolArray:
    """Return for which jumps the measured velocity says that the machine made none."""
    if "velocity" not in record or not len(at):
        return np.zeros(len(at), bool)
    t, velocity = record["position"].t, record["velocity"]
    around = [np.abs(np.interp(t[k], velocity.t, velocity.y)) for k in (at, at + 1)]
    brought = np.maximum(*around) * (t[at + 1] - t[at])
    return np.asarray(brought < _CONTRADICTED * np.abs(sizes))
