"""Months below a picture that is as wide as the page."""

from __future__ import annotations

from datetime import datetime, timezone

from rsea_ros.report.fleet.words import short_day
from rsea_ros.trends.weeks import Steps

_MOST = 6
"""Months that find room on a phone."""
_BEGIN, _END = 6.0, 96.0
"""Percent of the width: a name before _BEGIN starts at its place, one behind _END has no room."""
_STRIDES = (1, 2, 3, 6, 12, 24, 60, 120)


def share(time_s: float, steps: Steps) -> float:
    """Return where a time lies in a picture, 0 to 100 %."""
    first, last = float(steps.edges[0]), float(steps.edges[-1])
    return min(100.0, max(0.0, 100.0 * (time_s - first) / (last - first)))


def months(steps: Steps) -> str:
    """Return the HTML of the names of months at their places; of days where all lies in two months."""
    first, last = (datetime.fromtimestamp(float(t), timezone.utc) for t in (steps.edges[0], steps.edges[-1]))
    whole = 12 * (last.year - first.year) + last.month - first.month
    if whole < 2:
        return _below([(float(steps.edges[0]), short_day(float(steps.edges[0])))], steps)
    stride = next((s for s in _STRIDES if whole / s <= _MOST), _STRIDES[-1])
    every = [12 * first.year + first.month - 1 + k for k in range(1, whole + 1)]
    starts = [datetime(m // 12, m % 12 + 1, 1, tzinfo=timezone.utc) for m in every if m % stride == 0]
    shown = [t for t in starts if share(t.timestamp(), steps) < _END]
    return _below([(t.timestamp(), _month(t, t is shown[0])) for t in shown], steps)


def _month(time: datetime, first: bool) -> str:
    """Return the name of a month, with its year below it for the first and each January."""
    _, month, year = short_day(time.timestamp()).split()
    return f"{month}\n{year}" if first or time.month == 1 else month


def _below(marks: list[tuple[float, str]], steps: Steps) -> str:
    shown = [(share(t, steps), text) for t, text in marks]
    edge = [' class="edge"' if x < _BEGIN else "" for x, _ in shown]
    spans = "".join(
        f'<span{c} style="left:{x:.1f}%">{text}</span>' for c, (x, text) in zip(edge, shown, strict=True)
    )
    return f'<div class="months">{spans}</div>'
