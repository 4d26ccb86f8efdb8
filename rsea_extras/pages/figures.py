"""Figures of a joint over time: a parameter with its course and changes, a cause by its size or its share."""

from typing import Any

import numpy as np

from rsea_extras.pages import words as say
from rsea_extras.trends.result import Alarm, Binned, Change, Interval, Steps, Trend, bin_days
from rsea_extras.trends.series import DAY, YEAR, Naming
from rsea_ros.extension.base import FloatArray
from rsea_ros.extension.page import fig, words

_DAY = "%-d %b\n%Y"
_FEW = 14
"""Days up to which each has its name: plotly would name their hours."""
_BAR = 0.9 * 86_400_000.0
"""Width of a bar, ms for each day of its step: plotly draws a single bar without one as a hairline."""
_AHEAD = 0.5
"""Share of the time covered up to which a trend is drawn on."""
_MARGIN = {"l": 64, "r": 24, "t": 12, "b": 40}
_ACROSS: fig.Json = {"xref": "paper", "x0": 0.0, "x1": 1.0}


def date_axis(steps: Steps, until_s: float = 0.0) -> fig.Json:
    """Return an axis of dates over all steps, longer where something lies beyond them."""
    end = max(float(steps.edges[-1]), until_s)
    days = (end - float(steps.edges[0])) / DAY
    ticks = (
        {"dtick": 1000.0 * DAY * (1 if days <= _FEW / 2 else 2), "tickformat": _DAY} if days <= _FEW else {}
    )
    formats = [{"dtickrange": [None, "M1"], "value": _DAY}, {"dtickrange": ["M1", None], "value": "%b\n%Y"}]
    base = {"showgrid": False, "hoverformat": "%e %b %Y", "tickformatstops": [] if ticks else formats}
    return fig.axis("", type="date", range=say.dates(steps.edges[0], end), **base, **ticks)


def _change_marks(change: Change | Alarm) -> list[fig.Json]:
    """Return a line where something changed, and a band where it may have."""
    a, b, c = say.dates(change.earliest_s, change.since_s, change.latest_s)
    common = {"xref": "x", "yref": "paper", "y0": 0.0, "y1": 1.0}
    band = {"type": "rect", "x0": a, "x1": c, "fillcolor": fig.faint(fig.BEFORE, 0.14), "line": {"width": 0}}
    stroke = {"type": "line", "x0": b, "x1": b, "line": {"color": fig.BEFORE, "width": 1.2, "dash": "dot"}}
    return [{**common, **band, "layer": "below"}, {**common, **stroke}]


def _bars(colour: str, sides: FloatArray, below: FloatArray | None = None, **look: Any) -> fig.Json:
    lopsided = {} if below is None else {"symmetric": False, "arrayminus": fig.numbers(below)}
    return {"type": "data", "array": fig.numbers(sides), "color": colour, "width": 0, **lopsided, **look}


def naming_figure(naming: Naming, appearance: Alarm | None, steps: Steps) -> fig.Figure:
    """Return a cause by its size; without one, and of a fault, the share of recordings that name it."""
    plain = say.name(naming.about) + (" in the data" if naming.kind == "fault" else "")
    often = f"{int(np.sum(naming.named))} of {len(naming.named)} recordings"
    title = f"{plain}{' is named' if naming.kind == 'cause' else ''} in {often}"
    if appearance is not None:
        plain = plain if naming.kind == "fault" else say.cause_name(appearance)
        title = f"{plain} {say.beginning(appearance)}{say.size_now(appearance)}"
    since = [] if appearance is None or appearance.from_first else _change_marks(appearance)
    if naming.size is None or not np.any(np.isfinite(naming.size)):
        return _shares(naming, title, since, steps)
    typical = float(np.nanmedian(np.abs(naming.size)))
    factor, unit = (100.0, "%") if naming.unit == "1" else words.unit_factor(typical, naming.unit)
    limit, note = naming.limit * factor, []
    if np.isfinite(limit):
        note.append(fig.label("detection limit", 0.0, limit, fig.QUIET, xref="paper", yanchor="bottom"))
        since.append({"type": "rect", **_ACROSS, "y0": 0.0, "y1": limit, "layer": "below",
                      "fillcolor": fig.faint(fig.NOISE, 0.18), "line": {"width": 0}})  # fmt: skip
    height = fig.axis(f"{naming.parameter.replace('_', ' ')}, {unit}".rstrip(", "), rangemode="tozero")
    return fig.Figure(
        title,
        f"Median size of each {steps.name}, with the middle half. Grey at zero: recordings that do not name "
        "it; below the detection limit they could not.",
        _sizes(naming, naming.size * factor, unit, steps),
        fig.layout(xaxis=date_axis(steps), yaxis=height, shapes=since, annotations=note, margin=_MARGIN),
        height=260,
    )


def _sizes(naming: Naming, size: FloatArray, unit: str, steps: Steps) -> list[fig.Json]:
    """Return sizes where it is named, and marks at zero where it is not. size: in the axis' unit."""
    usable = naming.named & np.isfinite(size)
    place = steps.place(naming.time_s[usable])
    weeks = np.unique(place)
    low, middle, high = (
        np.array([np.quantile(size[usable][place == k], q) for k in weeks]) for q in (0.25, 0.5, 0.75)
    )
    sides = _bars(fig.faint(fig.BEFORE, 0.6), high - middle, middle - low, thickness=1.2)
    without = say.dates(*steps.middle[steps.count(naming.time_s[~naming.named]) > 0])
    return [
        fig.points(say.dates(*steps.middle[weeks]), middle, "named", fig.BEFORE, 6, error_y=sides,
               hovertemplate=f"%{{y:.4g}} {unit}"),
        fig.points(without, [0.0] * len(without), "not named", fig.NOISE, 4, hovertemplate="not named"),
    ]  # fmt: skip


def _shares(naming: Naming, title: str, since: list[fig.Json], steps: Steps) -> fig.Figure:
    asked, named = steps.count(naming.time_s), steps.count(naming.time_s[naming.named])
    some = asked > 0
    bars = {
        "type": "bar", "name": "recordings", "width": _BAR * steps.days, "x": say.dates(*steps.middle[some]),
        "y": fig.numbers(100.0 * named[some] / asked[some]),
        "marker": {"color": fig.faint(fig.BEFORE if naming.kind == "cause" else fig.MEASURED, 0.8)},
        "customdata": np.column_stack([named[some], asked[some]]).tolist(),
        "hovertemplate": "%{customdata[0]} of %{customdata[1]} recordings<extra></extra>",
    }  # fmt: skip
    drawing = fig.layout(
        xaxis=date_axis(steps), yaxis=fig.axis("%", range=[0.0, 102.0]), shapes=since, margin=_MARGIN
    )
    return fig.Figure(
        title, f"Share of the recordings of each {steps.name} that name it.", [bars], drawing, height=200
    )


def parameter_figure(trend: Trend, steps: Steps) -> fig.Figure:
    """Return the figure of a parameter that the recordings determine: course, changes, forecast."""
    factor, unit = words.unit_factor(trend.now.value if trend.now else 1.0, trend.series.unit)
    assert trend.curve is not None
    ahead, until = _ahead(trend, steps, factor)
    bins, dated = bin_days(trend, steps), [c for c in trend.changes if not c.open_start]
    shapes, labels = [m for c in dated for m in _change_marks(c)], [_label(c, trend) for c in dated]
    margin = {**_MARGIN, "t": 30 if labels else 12}
    if trend.to_limit_s is not None and trend.to_limit_s.value <= until:
        y = float(trend.limit * factor)
        shapes.append(
            {"type": "line", **_ACROSS, "y0": y, "y1": y, "line": {"color": fig.BEFORE, "width": 1}}
        )
        labels.append(fig.label("limit", 0.0, y, fig.BEFORE, xref="paper", yanchor="bottom"))
    return fig.Figure(
        say.finding(trend),
        _caption(trend),
        [*_course(trend, factor), *ahead, *_weeks(bins, trend, steps, factor, unit)],
        fig.layout(
            xaxis=date_axis(steps, until),
            yaxis=fig.axis(f"{say.name(trend.series.parameter)}, {unit}".rstrip(", "), hoverformat=".4g"),
            yaxis2={"overlaying": "y", "range": [0.0, 1.0], "visible": False, "fixedrange": True},
            shapes=shapes,
            annotations=labels,
            margin=margin,
        ),
        height=300,
    )


def _weeks(bins: Binned, trend: Trend, steps: Steps, factor: float, unit: str) -> list[fig.Json]:
    """Return the mean of each step, and marks below those that could not determine it."""
    some, none = np.isfinite(bins.value), (bins.recorded > 0) & (bins.identifiable == 0)
    time_s = trend.series.time_s
    places = say.dates(*np.clip(steps.middle, time_s[0], time_s[-1])[some])
    half = (bins.high - bins.low)[some] * factor / 2.0
    sides = _bars(fig.faint(fig.MEASURED, 0.7), half, thickness=1)
    cross = {"symbol": "x-thin-open", "size": 7, "color": fig.NOISE}
    missing = {"hovertemplate": "not enough excitation", "yaxis": "y2", "marker": cross}
    bottom = say.dates(*steps.middle[none])
    return [
        fig.points(
            places, bins.value[some] * factor, steps.name, fig.MEASURED, 5, error_y=sides,
            customdata=np.column_stack([bins.identifiable[some], bins.recorded[some]]).astype(int).tolist(),
            hovertemplate=f"%{{y:.7g}} {unit}, %{{customdata[0]}} of %{{customdata[1]}} recordings",
        ),
        fig.points(bottom, [0.02] * len(bottom), "could not be determined", fig.NOISE, 7, **missing),
    ]  # fmt: skip


def _course(trend: Trend, factor: float) -> list[fig.Json]:
    assert trend.curve is not None
    c, x = trend.curve, say.dates(*trend.curve.time_s)
    sides = fig.band(x, c.low * factor, c.high * factor, fig.faint(fig.AFTER, 0.16))
    return [sides, fig.line(x, c.value * factor, "trend", fig.AFTER, 2, hoverinfo="skip")]


def _ahead(trend: Trend, steps: Steps, factor: float) -> tuple[list[fig.Json], float]:
    """Return a sure trend extrapolated to its limit, or a sensible time, and its end (POSIX s)."""
    now, slope = trend.now, trend.per_year
    if trend.state != "trending" or now is None or slope is None or trend.curve is None:
        return [], 0.0
    last = float(trend.curve.time_s[-1])
    until = last + _AHEAD * float(steps.edges[-1] - steps.edges[0])
    if trend.to_limit_s is not None:
        until = min(until, trend.to_limit_s.high)
    years = (until - last) / (YEAR * DAY)
    ends = Interval(*(n + years * s for n, s in zip(now, slope, strict=True)))
    x, (value, low, high) = say.dates(last, until), factor * np.array([now, ends]).T
    sides = fig.band(x, low, high, fig.faint(fig.BEFORE, 0.15))
    return [sides, fig.line(x, value, "forecast", fig.BEFORE, 1.6, "dash", hoverinfo="skip")], until


def _label(change: Change, trend: Trend) -> fig.Json:
    share = change.size.value / abs(trend.first.value) if trend.first and trend.first.value else np.nan
    text = f"{say.percent(share)}, " if np.isfinite(share) else ""
    x: Any = say.dates(change.since_s)[0]
    at: fig.Json = {"yref": "paper", "yanchor": "bottom", "xanchor": "center"}
    return fig.label(f"{text}{say.day(change.since_s, short=True)}", x, 1.0, fig.BEFORE, **at)


def _caption(trend: Trend) -> str:
    s, now = trend.series, trend.now
    parts = [f"Now {say.value(now, s.unit)}"] if now else []
    if now and trend.per_kelvin is not None:
        parts[0] += f", at the mean temperature; a kelvin makes {say.percent(trend.per_kelvin.value)} of it"
    if now and now.value and trend.day_sd > 0.0:
        parts.append(f"Days scatter by {say.amount(trend.day_sd / abs(now.value))}")
    return ". ".join([*parts, f"{determined_by(trend)} recordings determine it."])


def determined_by(trend: Trend) -> str:
    """Return how many recordings determine a parameter, `6 of 8`."""
    return f"{int(np.sum(trend.series.identifiable))} of {len(trend.series.identifiable)}"
