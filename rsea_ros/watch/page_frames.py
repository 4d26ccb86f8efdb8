"""Frames for the page, thinned."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any, Protocol

Samples = Sequence[tuple[float, float]]
"""Time, s, and value of each sample."""


def extremes(samples: Samples) -> Samples:
    """Return the least and the largest of some samples in order, one where they are the same, none of none.

    Not-a-number is left out.
    """
    known = [s for s in samples if s[1] == s[1]]
    if len(known) < 2:
        return known
    low, high = min(known, key=_value), max(known, key=_value)
    if low is high:
        return [known[-1]]
    return [low, high] if low[0] <= high[0] else [high, low]


def _value(sample: tuple[float, float]) -> float:
    return sample[1]


CHANNELS = ("command", "motor", "ft", "proximal", "distal", "disturbance", "deflection")
"""Torques N m, deflection rad."""


class FrameSource(Protocol):
    """The source of the page's numbers; called by one thread, and never blocks.

    flag: whether the actuator is a pure torque source, None: unknown.
    """

    flag: bool | None

    def take(self) -> Mapping[str, Samples]:
        """Return the samples of CHANNELS that have come since the last call: s since the start, value."""

    def state(self) -> Mapping[str, Any]:
        """Return the slow state: flag, health, rates, limits."""


def frame(batch: Mapping[str, Samples], flag: bool | None) -> str | None:
    """Return a frame as JSON, None when nothing has come.

    {"t0": s, "pure": true, "ft": [ms, value, ms, value], …}: the extremes of each channel, in order.
    """
    kept = {name: extremes(samples) for name, samples in batch.items()}
    firsts = [samples[0][0] for samples in kept.values() if samples]
    if not firsts:
        return None
    begin = min(firsts)
    rows = {name: _flat(samples, begin) for name, samples in kept.items() if samples}
    return json.dumps({"t0": round(begin, 4), "pure": flag, **rows}, separators=(",", ":"))


def _flat(samples: Samples, begin: float) -> Sequence[float]:
    return [x for t, v in samples for x in (round(1e3 * (t - begin), 1), float(f"{v:.6g}"))]
