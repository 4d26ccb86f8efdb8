"""The figure of where the simulation is wrong: residual against load, speed, rotor angle and time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rsea_ros.documents.wording import list_names
from rsea_ros.records.record import FloatArray
from rsea_ros.report import words
from rsea_ros.report.diagnosis import words as say
from rsea_ros.report.diagnosis.profile import Profile
from rsea_ros.report.figures.figure import Figure, Json, axis, label, layout, line
from rsea_ros.report.figures.palette import AFTER, BEFORE, NOISE, QUIET

_DEPENDS = 1.5
_GAP = 0.035
_MARGIN, _MANY_DECADES = 0.15, 2.5
_ABOVE = 0.05
"""Decades that a label stays above the noise's."""


def where_figure(profiles: Sequence[Profile], changed: bool, colour: str = BEFORE) -> Figure:
    """Return one panel for each respect, side by side.

    changed: whether to draw the residual with the causes too. colour: of the residual without them.
    """
    data: list[Json] = []
    axes: Json = {"yaxis": _level_axis(profiles)}
    for i, profile in enumerate(profiles):
        suffix = "" if i == 0 else str(i + 1)
        left, right = _domain(i, len(profiles))
        unit = words.unit(profile.unit)
        axes[f"xaxis{suffix}"] = axis(f"{say.respect(profile.what)}, {unit}", domain=[left, right], nticks=5)
        data += _traces(profile, f"x{suffix}", changed, colour)
    return Figure(
        title=finding(profiles),
        caption="RMS of the residual over the noise. Bins of load and speed hold equally many samples.",
        data=data,
        layout=layout(**axes, annotations=_labels(profiles[-1], changed, colour), hovermode="closest"),
        height=320,
    )


def finding(profiles: Sequence[Profile]) -> str:
    """Return a sentence on the signal that the residual depends on most, and where it is largest.

    Time comes last: in a sweep it is a proxy for the frequency.
    """
    physical = [p for p in profiles if p.what != "time"]
    most = max(physical or profiles, key=lambda p: p.contrast)
    if most.contrast >= _DEPENDS or not physical:
        return f"The residual depends most on {say.respect(most.what)}: {_extremes(most)}"
    respects = list_names([say.respect(p.what) for p in physical], "or")
    alike = f"The residual is the same at every {respects}"
    changing = [p for p in profiles if p.what == "time" and p.contrast >= _DEPENDS]
    return f"{alike}; over time it changes: {_extremes(changing[0])}" if changing else alike


def _extremes(profile: Profile) -> str:
    k = int(np.nanargmax(profile.before))
    low, high = profile.edges[k : k + 2]
    most, least = (words.number(v(profile.before), 2) for v in (np.nanmax, np.nanmin))
    return f"{most} times the noise from {words.span(low, high, profile.unit)}, {least} where it is least"


def _traces(profile: Profile, x: str, changed: bool, colour: str) -> list[Json]:
    place: Json = {"xaxis": x, "yaxis": "y"}
    ends = profile.edges[[0, -1]]
    traces = [line(ends, np.ones(2), "noise", NOISE, 6.0, hoverinfo="skip", **place)]
    named = [("before", colour, profile.before), ("after", AFTER, profile.after)]
    for name, shade, values in named if changed else named[:1]:
        steps = np.append(values, values[-1])
        trace = line(profile.edges, steps, name, shade, 1.8, hovertemplate="%{y:.2f} times", **place)
        trace["line"]["shape"] = "hv"
        traces.append(trace)
    return traces


def _labels(last: Profile, changed: bool, colour: str) -> list[Json]:
    """Return the names at the right end of the last panel."""
    end: Json = {"xref": "paper", "yref": "y"}
    before, after = (max(_ABOVE, float(_decades(v[-1:])[0])) for v in (last.before, last.after))
    names = [label("noise", 1.01, 0.0, QUIET, yanchor="top", **end)]
    names.append(label("<b>before</b>" if changed else "<b>residual</b>", 1.01, before, colour, **end))
    return [*names, label("<b>after</b>", 1.01, after, AFTER, yanchor="bottom", **end)] if changed else names


def _domain(index: int, count: int) -> tuple[float, float]:
    width = (1.0 - _GAP * (count - 1)) / count
    left = index * (width + _GAP)
    return left, min(left + width, 1.0)


def _level_axis(profiles: Sequence[Profile]) -> Json:
    """Return the axis of all panels; 1, 2 and 5 of each decade stand as plain numbers."""
    values = _decades(np.concatenate([[0.6, 3.0], *([p.before, p.after] for p in profiles)], axis=None))
    low, high = float(np.nanmin(values)) - _MARGIN, float(np.nanmax(values)) + _MARGIN
    marks = [m * 10.0**e for e in range(-2, 7) for m in (1, 2, 5) if low <= np.log10(m * 10.0**e) <= high]
    shown = [m for m in marks if f"{m:e}"[0] == "1"] if high - low > _MANY_DECADES else marks
    text = [f"{m:g}" for m in shown]
    return axis("times the noise", type="log", range=[low, high], tickvals=shown, ticktext=text)


def _decades(levels: FloatArray) -> FloatArray:
    """Return log10 of levels, NaN for zero (a sensor at rest), which has no place on a logarithmic axis."""
    decades: FloatArray = np.log10(np.where(levels > 0.0, levels, np.nan))
    return decades
