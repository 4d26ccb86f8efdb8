"""Where a machine moved: a sensor that holds a value while nothing moves is sound."""

from __future__ import annotations

import math
from collections.abc import Collection
from typing import NamedTuple

import numpy as np

from rsea_ros.records.record import BoolArray, Channel, FloatArray, Record

WITNESSES = {
    "position": ("ft", "velocity", "motor_torque", "command"),
    "ft": ("position", "deflection", "velocity", "motor_torque", "command"),
    "deflection": ("ft", "position", "velocity", "motor_torque", "command"),
    "velocity": ("ft", "position", "motor_torque", "command"),
    "motor_torque": ("command",),
}
"""By sensor: who can say whether it had something to measure, the best first."""
_AROUND = 9
"""Samples over which a witness must have changed."""
_CLEARLY = 4.0
"""Times what the witness changes by where it is quietest: more is motion."""


class MotionBeside(NamedTuple):
    """Of another channel at a channel's samples: whether it moved, and by how much a sample, shape (n,)."""

    moved: BoolArray
    speed: FloatArray


def witness_of(record: Record, name: str, but: Collection[str] = ()) -> str | None:
    """Return the channel that shows best whether another had something to measure, None for none.

    but: channels that cannot be trusted.
    """
    able = (n for n in WITNESSES.get(name, ()) if n in record and n not in but and _is_witness(record[n]))
    return next(able, None)


def motion_beside(record: Record, name: str, witness: str | None) -> MotionBeside | None:
    """Return how a witness moved at the samples of a channel, None without a witness."""
    if witness is None:
        return None
    t, channel = record[name].t, record[witness]
    moved = np.interp(t, channel.t, moves(channel).astype(float)) >= 0.5
    speed = np.abs(np.diff(np.interp(t, channel.t, np.nan_to_num(channel.y)), prepend=np.nan))
    return MotionBeside(moved, np.nan_to_num(speed))


def is_commanded(record: Record) -> bool:
    """Return whether the command of a record changes, if there is one."""
    return "command" not in record or float(np.ptp(np.nan_to_num(record["command"].y))) > 0.0


def is_still(record: Record) -> bool:
    """Return whether every sensor shows only white noise, by its fourth differences."""
    return all(_is_noise(record[n]) for n in ("position", "velocity", "ft", "deflection") if n in record)


def _is_noise(channel: Channel) -> bool:
    y = channel.y[np.isfinite(channel.y)]
    if len(y) < 64:
        return False
    y = y / max(float(np.abs(y).max()), np.finfo(float).tiny)  # the squares of 1e300 are infinite
    white = float(np.std(np.diff(y, 4))) / math.sqrt(70.0)
    return float(np.std(y)) <= 1.5 * white


def at_rest(record: Record) -> float:
    """Return the share of the commands at which neither command nor machine moved."""
    t = record["command"].t
    still = ~moves(record["command"])
    for name in ("position", "velocity", "ft", "deflection"):
        if name in record and _is_witness(record[name]):
            moved = moves(record[name])
            still &= ~moved[np.clip(np.searchsorted(record[name].t, t), 0, len(moved) - 1)]
            break
    return float(still.mean())


def _is_witness(channel: Channel) -> bool:
    y = channel.y[np.isfinite(channel.y)]
    return len(y) > 2 * _AROUND and float(np.ptp(y)) > 0.0


def moves(channel: Channel) -> BoolArray:
    """Return at which samples a channel changes by more than its own noise, shape (n,)."""
    y = np.nan_to_num(channel.y, nan=float(np.nanmedian(channel.y)))
    if len(y) <= _AROUND:
        return np.zeros(len(y), bool)
    windows = np.lib.stride_tricks.sliding_window_view(np.pad(y, _AROUND // 2, mode="edge"), _AROUND)
    change = np.ptp(windows, axis=1)
    quiet = float(np.quantile(change, 0.02))
    largest = float(np.quantile(change, 0.99))
    clearly: BoolArray = change > max(min(_CLEARLY * quiet, 0.5 * largest), 1e-3 * largest)
    return clearly
