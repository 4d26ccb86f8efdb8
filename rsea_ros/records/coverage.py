"""Which parts of a record all channels cover, and rows in which one channel belongs to another instant.

For as long as the clock had stepped back by, every channel then has two samples where it has one elsewhere.
Which row is of which time is lost, so these rows are left out; before and behind them the run is whole.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rsea_ros.records.record import SENSED, Channel, Fault, FloatArray, Record

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


_AROUND = 16
"""Samples over which a rate is measured."""
_SHORTEST = 0.5
"""s."""
_DOUBLE = (1.7, 2.3)
"""Times the usual rate, within."""
_APART = 0.2
"""s. So far the spans of two channels may differ at their ends."""
_SAME = 0.25
"""Share of the steps without a change: where more have none, messages came twice."""


def without_mixed_rows(record: Record) -> tuple[Record, list[Fault]]:
    """Return the record without its rows of two times, and their fault."""
    spans = [_doubled_stretch(c) for c in record.channels.values() if len(c) > 4 * _AROUND]
    known = [span for span in spans if span is not None]
    if len(known) < 2 or len(known) < len(spans) or np.ptp(np.array(known), axis=0).max() > _APART:
        return record, []
    begin, end = min(a for a, _ in known), max(b for _, b in known)
    left = {
        n: Channel(c.t[keep], c.y[keep])
        for n, c in record.channels.items()
        for keep in [(c.t < begin) | (c.t > end)]
    }
    driving = record.driving or next(iter(record.channels.values()))
    share = float(np.mean((driving.t >= begin) & (driving.t <= end)))
    detail = (
        f"the clock stepped back by {end - begin:.3g} s, and rows of two times are mixed from {begin:.4g} s"
        f" to {end:.4g} s; they are left out"
    )
    return record.with_channels(**left), [Fault("mixed_rows", "command", share, detail, end - begin, "s")]


def _doubled_stretch(channel: Channel) -> tuple[float, float] | None:
    """Return begin and end (s) of the one stretch in which samples come twice as often, or None."""
    t = channel.t
    if np.any(np.diff(t) < 0.0):
        return None
    span = t[_AROUND:] - t[:-_AROUND]
    usual = float(np.quantile(span, 0.75))
    dense = np.flatnonzero(span < 0.75 * usual)
    if not len(dense) or usual <= 0.0:
        return None
    first, last = int(dense[0]), int(dense[-1]) + _AROUND
    length = float(t[last] - t[first])
    times = (last - first) / max(length, 1e-300) * usual / _AROUND
    whole = len(dense) > 0.9 * (dense[-1] - dense[0] + 1)
    same = _share_of_repeats(channel.y[first:last])
    if length < _SHORTEST or not _DOUBLE[0] < times < _DOUBLE[1] or not whole or same > _SAME:
        return None
    return float(t[first]), float(t[last])


def _share_of_repeats(y: FloatArray) -> float:
    """Return the share of samples that repeat the one before."""
    return float(np.mean(np.diff(y) == 0.0))
