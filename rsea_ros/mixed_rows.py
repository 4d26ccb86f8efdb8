"""Rows of two times mixed: the clock stepped back, and the log was sorted by its stamps afterwards.

For as long as the clock had stepped back by, every channel then has two samples where it has one elsewhere.
Which row is of which time is lost, so these rows are left out; before and behind them the run is whole.
"""

from __future__ import annotations

import numpy as np

from rsea_ros.signals import Channel, Fault, FloatArray, Record

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
