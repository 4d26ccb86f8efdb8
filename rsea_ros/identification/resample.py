"""One channel beside the command on the command's own clock, header stamps honoured.

The command is known at all times (it is held from stamp to stamp), the channel only at its own stamps. So
the command's clock is the grid, and the channel is shifted as little as possible: a constant offset stays an
offset, returned to the caller; only jitter, gaps and other rates are interpolated.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rsea_ros.errors import IdentificationError
from rsea_ros.records.record import BoolArray, Channel, FloatArray, Record

_FEWEST = 32
_STEADY = 1e-3
_LONGEST_GAP = 3
_DEGREE = 7
_DRAWN = 15


class AtRestError(IdentificationError):
    """The record has no response: nothing is commanded while a channel is measured."""


@dataclass(frozen=True)
class Aligned:
    """Command and one channel on the command's clock, both shape (n,).

    command[i], N m, is held from start + i period to start + (i + 1) period, s.
    output[i] was acquired at start + i period + delay. measured[i]: false inside gaps of the recording.
    offsets: of the samples from the grid, in periods: one value, or quantiles of them where they jitter.
    held: the channel is itself a hold, read at its end (motor torque).
    rate: sample rate of the channel, Hz.
    """

    name: str
    start: float
    period: float
    command: FloatArray
    output: FloatArray
    delay: float
    measured: BoolArray
    offsets: FloatArray
    held: bool
    rate: float


def align(record: Record, name: str) -> Aligned:
    """Lay a channel beside the command. Raises IdentificationError for too few samples in common."""
    command, channel = (usable(record[n], f"{record.source}: {n}") for n in ("command", name))
    start, period = grid_of(command, channel)
    place = (channel.t - start) / period
    held = name == "motor_torque"
    if held:
        place = np.rint(place) - 1.0
    offset = _offset(place)
    first, last = max(0, int(np.ceil(place[0] - offset - 1e-6))), int(place[-1] - offset + 1e-6)
    last = min(last, round((command.t[-1] - start) / period))
    if last - first < _FEWEST:
        raise IdentificationError(
            f"{record.source}: command and {name} overlap for {max(0, last - first)} samples, "
            f"expected at least {_FEWEST}"
        )
    index = np.arange(first, last + 1, dtype=np.float64)
    return Aligned(
        name=name,
        start=start + first * period,
        period=period,
        command=held_mean(command, start + period * np.append(index, last + 1.0)),
        output=_at(place, channel.y, index + offset),
        delay=offset * period,
        measured=_outside_gaps(place - offset, index),
        offsets=_offsets(place - offset) + offset,
        held=held,
        rate=channel.rate,
    )


def usable(channel: Channel, where: str) -> Channel:
    """Return the samples that are finite and whose stamps rise. Raises IdentificationError for too few."""
    finite = np.isfinite(channel.t) & np.isfinite(channel.y)
    t, y = channel.t[finite], channel.y[finite]
    rising = np.ones(len(t), bool)
    rising[1:] = t[1:] > np.maximum.accumulate(t)[:-1]
    if np.count_nonzero(rising) < _FEWEST:
        raise IdentificationError(
            f"{where} has {np.count_nonzero(rising)} usable samples, expected at least {_FEWEST}"
        )
    return Channel(t[rising], y[rising])


def grid_of(command: Channel, channel: Channel) -> tuple[float, float]:
    """Return start and period of the grid, s: the command's clock, divided where the channel is faster."""
    start, period = clock(command.t)
    finer = max(1, round(period * channel.rate))
    return start, period / finer


def clock(t: FloatArray) -> tuple[float, float]:
    """Return start and period of the clock behind jittery stamps with gaps, by least squares, s."""
    steps = np.diff(t)
    count = np.concatenate([[0.0], np.cumsum(np.rint(steps / np.median(steps)))])
    middle, spread = count - count.mean(), t - t.mean()
    period = float(middle @ spread / (middle @ middle))
    return float(t.mean() - period * count.mean()), period


def held_mean(command: Channel, edges: FloatArray) -> FloatArray:
    """Return the mean of the held command between neighbouring edges, shape (n - 1,)."""
    area = np.concatenate([[0.0], np.cumsum(command.y[:-1] * np.diff(command.t))])
    reach = np.interp(edges, command.t, area)
    reach += command.y[-1] * np.maximum(edges - command.t[-1], 0.0)
    reach += command.y[0] * np.minimum(edges - command.t[0], 0.0)
    means: FloatArray = np.diff(reach) / np.diff(edges)
    return means


def _offset(place: FloatArray) -> float:
    """Return the typical offset of samples from the grid, in periods, -0.5 … 0.5; 0 without one."""
    mean = np.exp(2j * np.pi * place).mean()
    return float(np.angle(mean) / (2.0 * np.pi)) if abs(mean) > 0.5 else 0.0


def _at(place: FloatArray, y: FloatArray, wanted: FloatArray) -> FloatArray:
    """Return the channel at the wanted places: unchanged where sampled, otherwise by a spline."""
    near = np.searchsorted(place, wanted - 0.5)
    near = np.minimum(near, len(place) - 1)
    if np.all(np.abs(place[near] - wanted) < _STEADY):
        return y[near]
    from scipy.interpolate import make_interp_spline  # 0.1 s that even stamps need not wait for

    spline: FloatArray = make_interp_spline(place, y, k=_DEGREE)(wanted)
    return spline


def _outside_gaps(place: FloatArray, index: FloatArray) -> BoolArray:
    """Return which places lie outside gaps longer than a spline can bridge."""
    step = np.diff(place)
    outside = np.ones(len(index), bool)
    for k in np.flatnonzero(step > max(1.0, float(np.median(step))) * (_LONGEST_GAP + 0.5)):
        outside[(index > place[k]) & (index < place[k + 1])] = False
    return outside


def _offsets(jitter: FloatArray) -> FloatArray:
    """Return quantiles of the samples' distance to the nearest place of the grid, one where it is steady."""
    distance = jitter - np.rint(jitter)
    if np.max(np.abs(distance)) < _STEADY:
        return np.zeros(1)
    quantiles: FloatArray = np.quantile(distance, (np.arange(_DRAWN) + 0.5) / _DRAWN)
    return quantiles
