"""Missing samples: gaps in the stamps, and hosts that poll unevenly."""

from __future__ import annotations

import numpy as np

from rsea_ros.signals import BoolArray, Channel, Fault, FloatArray
from rsea_ros.stamp_order import AROUND

GAP = 1.6
"""In sample periods: a longer interval is a gap."""
_FOLLOW = 0.2
"""How far the steady clock behind the stamps goes towards each of them."""
_OFTEN = 0.02
"""Share of the steps: where fewer are long, they are accidents and no habit of the host."""
_NO_MULTIPLE, _TIMES = 0.15, 3.0
"""In periods: so far off a whole number, and so many times farther than steps of one period are off, the
typical long step is no multiple."""


def dropped_samples(
    channel: Channel, name: str, taken_out: int, pauses: BoolArray | None = None
) -> list[Fault]:
    """Return the fault of missing samples.

    taken_out: how many had a stamp that was not theirs. pauses: steps, shape (n - 1,), without lost samples.
    """
    step = np.diff(channel.t)
    period = float(np.median(step)) if len(step) else 0.0
    step = step if pauses is None else np.where(pauses, period, step)
    if not np.any(step > GAP * period) or polls_unevenly(step, period):
        return []
    ticks = _ticks(step, period)
    lost = float(np.median(ticks[-3:] - np.arange(len(ticks))[-3:])) - taken_out
    if lost < 1.0:
        return []
    longest = int(np.argmax(step))
    detail = f"longest gap {step[longest]:.4g} s at {channel.t[longest]:.3f} s"
    return [Fault("dropped_samples", name, lost / (len(channel) + lost), detail, lost, "samples")]


def polls_unevenly(step: FloatArray, period: float) -> bool:
    """Return whether the long steps, s, are no multiples of a period: a host that polls as it can.

    A steady clock that lost samples leaves steps as near to a multiple as its others are to one period.
    """
    long = step > GAP * period
    if np.count_nonzero(long) < max(AROUND, _OFTEN * len(step)):
        return False
    off = np.abs(step / period - np.rint(step / period))
    usual = 0.0 if long.all() else float(np.median(off[~long]))
    return float(np.median(off[long])) > max(_NO_MULTIPLE, _TIMES * usual)


def _ticks(step: FloatArray, period: float) -> FloatArray:
    """Return at which tick of a steady clock each sample was taken, counted along the record.

    The clock follows the stamps slowly: jitter is made up for by the next samples, a gap is not.
    """
    tick, behind = 0, 0.0
    ticks = [0]
    for places in (step / period).tolist():
        passed = round(behind + places)
        behind = (1.0 - _FOLLOW) * (behind + places - passed)
        tick += passed
        ticks.append(tick)
    return np.array(ticks, np.float64)
