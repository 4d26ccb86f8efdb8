"""Stamps of a clock that is coarser than the samples."""

import numpy as np

from rsea_ros.records.record import FloatArray
from rsea_ros.records.stamps import even_behind_ticks

LONG = 1.5
"""Where the clock moved this many times its usual tick, whole ticks passed without a sample."""


def spread_repeats(t: FloatArray) -> tuple[FloatArray, str]:
    """Spread samples with equal stamps evenly until the clock's next tick; return a note.

    Where all stamps fit one even clock, that is used. Otherwise the first sample after a tick is dated by it
    to within one sample period, so the error of each stamp stays below that, whatever the rate does
    meanwhile; a line through all samples would be off by as much as the rate wanders.
    t: s, shape (n,), not decreasing. Returns t unchanged where no stamp repeats.
    """
    first = np.flatnonzero(np.diff(t, prepend=-np.inf))
    if len(first) == len(t) or len(first) < 2:
        return t, ""
    repeats = f"{len(t) - len(first)} of {len(t)} stamps repeat"
    even = even_behind_ticks(t)
    if even is not None:
        rate = 1.0 / (even[1] - even[0])
        return even, f"{repeats}: samples dated by the even clock that they fit, {rate:.4g} Hz"
    counts = np.diff(first, append=len(t))
    spans = np.diff(t[first])
    tick = float(np.median(spans))
    spans = np.append(np.where(spans > LONG * tick, tick, spans), tick)
    steps = spans / counts
    steps[-1] = min(steps[-2:])
    place = np.arange(len(t)) - np.repeat(first, counts)
    spread = t + place * np.repeat(steps, counts)
    if np.median(counts) > 1:  # the recording began within a tick
        spread[: counts[0]] = spread[first[1]] - (counts[0] - place[: counts[0]]) * min(steps[:2])
    slow, fast = 1.0 / np.quantile(steps, [0.95, 0.05])
    return spread, (
        f"{repeats} (clock of {tick * 1e3:.3g} ms):"
        f" samples spread evenly between its ticks, {slow:.0f} to {fast:.0f} Hz"
    )
