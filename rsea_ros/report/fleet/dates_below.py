"""Months below a picture that is as wide as the page."""

from __future__ import annotations

from datetime import datetime, timezone

from rsea_ros.report.fleet.words import short_day
from rsea_ros.trends.weeks import Steps

_MOST = 6
"""Months that find room on a phone."""
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
    return _below([(t.timestamp(), short_day(t.timestamp())[2:]) for t in starts], steps)


def _below(marks: list[tuple[float, str]], steps: Steps) -> str:
    shown = [(share(t, steps), text) for t, text in marks]
    spans = "".join(f'<span style="left:{x:.1f}%">{text}</span>' for x, text in shown if x < 96.0)
    return f'<div class="months">{spans}</div>'
