"""A parameter of a joint over time: weeks with intervals, its course, changes, and where it is going."""

from __future__ import annotations

import numpy as np

from rsea_ros.records.record import FloatArray
from rsea_ros.report import words
from rsea_ros.report.figures.figure import Figure, Json, axis, label, layout, numbers
from rsea_ros.report.figures.palette import AFTER, BEFORE, MEASURED, NOISE, faint
from rsea_ros.report.fleet.marks import change_marks, date_axis, points
from rsea_ros.report.fleet.words import amount, dates, finding, name, percent, short_day, value
from rsea_ros.trends.result import Change, Interval, Trend
from rsea_ros.trends.settings import DAY, YEAR
from rsea_ros.trends.weeks import Binned, Steps, bin_days

_FINE = 0.02
"""Share of the course's interval to which values are drawn."""
_AHEAD = 0.5
"""Share of the time covered up to which a trend is drawn on."""


def parameter_figure(trend: Trend, steps: Steps) -> Figure:
    """Return the figure of a parameter that the recordings determine."""
    factor, unit = words.unit_factor(trend.now.value if trend.now else 1.0, trend.series.unit)
    bins = bin_days(trend, steps)
    fine = _fine(trend) * abs(factor)
    ahead, until = _ahead(trend, steps, factor)
    marks = [m for c in trend.changes if not c.open_start
             for m in change_marks(c.since_s, c.earliest_s, c.latest_s)]  # fmt: skip
    labels = [_label(c, trend) for c in trend.changes if not c.open_start]
    limit, limit_label = _limit(trend, factor, until)
    return Figure(
        title=finding(trend),
        caption=_caption(trend),
        data=[
            *_course(trend, factor, fine),
            *ahead,
            _weeks(bins, _places(trend, steps), steps.name, factor, unit, fine),
            _undetermined_marks(bins, steps),
        ],
        layout=layout(
            xaxis=date_axis(steps, until),
            yaxis=axis(f"{name(trend.series.parameter)}, {unit}".rstrip(", "), hoverformat=".4g"),
            yaxis2={"overlaying": "y", "range": [0.0, 1.0], "visible": False, "fixedrange": True},
            shapes=[*marks, *limit],
            annotations=[*labels, *limit_label],
            margin={"l": 64, "r": 24, "t": 30 if labels else 12, "b": 40},
        ),
        height=300,
    )


def _places(trend: Trend, steps: Steps) -> FloatArray:
    """Return the middle of each step, POSIX s, between the first recording and the last."""
    places: FloatArray = np.clip(steps.middle, trend.series.time_s[0], trend.series.time_s[-1])
    return places


def _weeks(bins: Binned, time_s: FloatArray, step: str, factor: float, unit: str, fine: float) -> Json:
    """Return the mean of each step. fine: resolution, in the unit."""
    some = np.isfinite(bins.value)
    y, half = bins.value[some] * factor, (bins.high - bins.low)[some] * factor / 2.0
    return points(
        time_s[some],
        numbers(y, fine),
        step,
        marker={"color": MEASURED, "size": 5},
        error_y={
            "type": "data",
            "array": numbers(half),
            "color": faint(MEASURED, 0.7),
            "thickness": 1,
            "width": 0,
        },
        customdata=[
            [int(a), int(b)] for a, b in zip(bins.identifiable[some], bins.recorded[some], strict=True)
        ],
        hovertemplate=f"%{{y:.7g}} {unit}, %{{customdata[0]}} of %{{customdata[1]}} recordings",
    )


def _fine(trend: Trend) -> float:
    """Return a resolution at which the interval of the course can be drawn, in the parameter's unit."""
    assert trend.curve is not None
    return _FINE * float(np.median(trend.curve.high - trend.curve.low))


def _undetermined_marks(bins: Binned, steps: Steps) -> Json:
    """Return a mark at the bottom for each week whose recordings could not determine the parameter."""
    none = (bins.recorded > 0) & (bins.identifiable == 0)
    return points(
        steps.middle[none],
        [0.02] * int(np.sum(none)),
        "could not be determined",
        yaxis="y2",
        marker={"symbol": "x-thin-open", "size": 7, "color": NOISE},
        hovertemplate="not enough excitation",
    )


def _course(trend: Trend, factor: float, fine: float) -> list[Json]:
    """Return the course as a line in its band."""
    assert trend.curve is not None
    c = trend.curve
    x = dates(c.time_s)
    band = {
        "type": "scatter", "mode": "lines", "x": [*x, *x[::-1]], "fill": "toself", "hoverinfo": "skip",
        "y": numbers(np.concatenate([c.high, c.low[::-1]]) * factor, fine), "line": {"width": 0},
        "fillcolor": faint(AFTER, 0.16),
    }  # fmt: skip
    stroke = points(c.time_s, numbers(c.value * factor, fine), "trend", mode="lines", hoverinfo="skip",
                    line={"color": AFTER, "width": 2})  # fmt: skip
    return [band, stroke]


def _ahead(trend: Trend, steps: Steps, factor: float) -> tuple[list[Json], float]:
    """Return a sure trend extrapolated to its limit, or a sensible time, and its end (POSIX s)."""
    if trend.state != "trending" or trend.now is None or trend.per_year is None or trend.curve is None:
        return [], 0.0
    last = float(trend.curve.time_s[-1])
    until = last + _AHEAD * float(steps.edges[-1] - steps.edges[0])
    if trend.to_limit_s is not None:
        until = min(until, trend.to_limit_s.high)
    years = (until - last) / (YEAR * DAY)
    now, slope = trend.now, trend.per_year
    ends = Interval(*(n + years * s for n, s in zip(now, slope, strict=True)))
    x = dates([last, until, until, last])  # type: ignore[arg-type]
    fan = {"type": "scatter", "mode": "lines", "x": x, "y": numbers(np.array(
        [now.high, ends.high, ends.low, now.low]) * factor), "fill": "toself", "line": {"width": 0},
        "fillcolor": faint(BEFORE, 0.15), "hoverinfo": "skip"}  # fmt: skip
    y = numbers(np.array([now.value, ends.value]) * factor)
    dashed = {"color": BEFORE, "width": 1.6, "dash": "dash"}
    stroke = points(np.array([last, until]), y, "forecast", mode="lines", line=dashed, hoverinfo="skip")
    return [fan, stroke], until


def _limit(trend: Trend, factor: float, until: float) -> tuple[list[Json], list[Json]]:
    if trend.to_limit_s is None or trend.to_limit_s.value > until:
        return [], []
    y = float(trend.limit * factor)
    shape = {"type": "line", "xref": "paper", "x0": 0.0, "x1": 1.0, "y0": y, "y1": y,
             "line": {"color": BEFORE, "width": 1}}  # fmt: skip
    text = label("limit", 0.0, y, BEFORE, xref="paper", yanchor="bottom")
    return [shape], [text]


def _label(change: Change, trend: Trend) -> Json:
    share = change.size.value / abs(trend.first.value) if trend.first and trend.first.value else np.nan
    text = (
        f"{percent(share)}, {short_day(change.since_s)}" if np.isfinite(share) else short_day(change.since_s)
    )
    x = dates([change.since_s])[0]  # type: ignore[arg-type]
    return label(text, x, 1.0, BEFORE, yref="paper", yanchor="bottom", xanchor="center")  # type: ignore[arg-type]


def _caption(trend: Trend) -> str:
    s = trend.series
    parts = [f"Now {value(trend.now, s.unit)}" if trend.now else ""]
    if trend.per_kelvin is not None:
        parts[0] += f", at the mean temperature; a kelvin makes {percent(trend.per_kelvin.value)} of it"
    level = abs(trend.now.value) if trend.now else 0.0
    if level and trend.day_sd > 0.0:
        parts.append(f"Days scatter by {amount(trend.day_sd / level)}")
    parts.append(f"{int(np.sum(s.identifiable))} of {len(s.identifiable)} recordings determine it")
    return ". ".join(p for p in parts if p) + "."
