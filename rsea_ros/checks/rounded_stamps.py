"""Stamps that a logger rounded: their error is larger than a fit can take for none.

Stamps at whole multiples of a step s, of samples whose period is no multiple of it, are off by up to s / 2.
"""

from __future__ import annotations

import numpy as np

from rsea_ros.identification.even_stamps import SCATTER
from rsea_ros.records.record import Channel, Fault, FloatArray

_STEPS = (1.0, 0.1, 1e-2, 1e-3, 1e-4, 1e-5)
"""s, to which loggers round."""
_NEAR = 0.01
"""Of a step: as near to a multiple stamps of 1.7e9 s are in a double, at steps of 10 µs and more."""
_OFTEN = 0.02
"""Share of the intervals: where fewer are no multiple of the usual one, samples are late."""
_FEWEST = 10
"""Intervals: of fewer any may be whole by chance."""


def rounded_stamps(channel: Channel, name: str) -> list[Fault]:
    """Return the fault of stamps that were rounded by more than a small part of the sample period."""
    interval = np.diff(channel.t)
    interval = interval[interval > 0.0]
    if len(interval) < _FEWEST:
        return []
    period = float(np.median(interval))
    step = next((s for s in _STEPS if _is_whole(interval, s)), 0.0)
    off = interval - period * np.rint(interval / period)  # behind lost samples it is some periods
    uneven = float(np.mean(np.abs(off) > 0.5 * step))
    if step / np.sqrt(12.0) < SCATTER * period or uneven < _OFTEN:
        return []
    detail = f"whole {_step_text(step)}, off by up to {1e3 * step / 2:g} ms at {channel.rate:.4g} Hz"
    return [Fault("rounded_stamps", name, 1.0, detail)]


def _is_whole(interval: FloatArray, step: float) -> bool:
    """Return whether all intervals, s, are whole multiples of a step."""
    places = interval / step
    whole = np.rint(places)
    return bool(np.all((whole > 0.0) & (np.abs(places - whole) < _NEAR)))


def _step_text(step: float) -> str:
    """Return a step, s, in the unit in which it is whole."""
    if step >= 1.0:
        return "s"
    size, unit = (1e3 * step, "ms") if step > 0.5e-3 else (1e6 * step, "µs")
    return unit if round(size) == 1 else f"multiples of {size:.0f} {unit}"
