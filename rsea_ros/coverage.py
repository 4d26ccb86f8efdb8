"""Spans of a run without one of its channels: a sensor that starts late, commands that end early."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rsea_ros.signals import SENSED, Channel, Fault, Record

_FEWEST = 10
"""Samples of a channel: fewer say little of when it started."""
_ABSENT, _ABSENT_PERIODS, _ABSENT_SHARE = 0.5, 10.0, 0.02
"""s, sample periods, and share of the run: as late as that a sensor may start, by the start of a recorder."""
_MOVED = 0.1
"""Of its range in the run: a sensor that changes more before the first command saw a motion."""


def absent_spans(record: Record) -> list[Fault]:
    """Return a fault for each sensor that starts late or ends early, and for commands that do.

    Commands that start after the sensors are usual, the bench runs before its excitation does; they are a
    fault where the machine moved before.
    """
    driving = record.driving
    if driving is None or len(driving) < _FEWEST:
        return []
    last = max(float(c.t[-1]) for c in record.channels.values() if len(c))
    faults = []
    for name, channel in record.channels.items():
        if len(channel) < 2:
            continue
        start, stop = (driving.t[0], driving.t[-1]) if channel is not driving else (_first(record), last)
        longest = max(_ABSENT, _ABSENT_PERIODS / channel.rate, _ABSENT_SHARE * float(stop - start))
        late, early = float(channel.t[0] - start), float(stop - channel.t[-1])
        spans = [(late, start, channel.t[0])] if late > longest else []
        spans += [(early, channel.t[-1], stop)] if early > longest else []
        if spans:
            held = ", the last command is held" if channel is driving and early > longest else ""
            faults.append(_absence(name, spans, float(stop - start), held))
    return faults


def _first(record: Record) -> float:
    """Return when the machine first moved before the commands, s; their start where it did not."""
    driving = record.driving
    assert driving is not None
    start = float(driving.t[0])
    before = [(c, c.between(-np.inf, start)) for c in map(record.channels.get, SENSED) if c is not None]
    moving = [float(b.t[0]) for c, b in before if len(b) >= _FEWEST and _range(b) > _MOVED * _range(c)]
    return min(moving, default=start)


def _range(channel: Channel) -> float:
    """Return the range of the finite values of a channel."""
    y = channel.y[np.isfinite(channel.y)]
    return float(np.ptp(y)) if len(y) else 0.0


def _absence(name: str, spans: Sequence[tuple[float, float, float]], whole: float, then: str) -> Fault:
    """Return the fault of the spans without a channel: length, begin and end each, s. whole: the run, s."""
    lost = sum(length for length, _, _ in spans)
    detail = " and ".join(f"nothing from {a:.4g} s to {b:.4g} s" for _, a, b in spans)
    return Fault("partly_recorded", name, lost / whole, detail + then, lost, "s")
