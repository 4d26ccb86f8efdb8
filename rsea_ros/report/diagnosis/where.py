"""Where the simulation is wrong: its residual over the noise against load, speed, rotor angle and time."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from rsea_ros.diagnosis.residual_analysis import edges_of, rms_in
from rsea_ros.diagnosis.result import Diagnosis
from rsea_ros.documents.wording import list_names
from rsea_ros.identification.result import Overlay
from rsea_ros.model.extent import SKIPPED_START
from rsea_ros.records.record import UNITS, FloatArray
from rsea_ros.report import words
from rsea_ros.report.diagnosis import words as say
from rsea_ros.report.figures.figure import Figure, Json, axis, label, layout, line
from rsea_ros.report.figures.palette import AFTER, BEFORE, NOISE, QUIET

BINS = 16
_FEWEST = 4 * BINS
_DEPENDS = 1.5
_GAP = 0.035
_MARGIN, _MANY_DECADES = 0.15, 2.5
_ABOVE = 0.05
"""Decades that a label stays above the noise's."""


@dataclass(frozen=True)
class Profile:
    """The residual laid out against one respect.

    edges: of the bins in `unit`, shape (n + 1,). before, after: RMS over the noise, shape (n,).
    """

    what: str
    unit: str
    edges: FloatArray
    before: FloatArray
    after: FloatArray

    @property
    def contrast(self) -> float:
        """Largest over smallest RMS before: how much the residual depends on this respect."""
        return float(np.nanmax(self.before) / max(float(np.nanmin(self.before)), 1e-12))


def profiles(diagnosis: Diagnosis, channel: str) -> tuple[Profile, ...]:
    """Return a profile over every signal that the record has."""
    before, after = ({o.channel: o for o in overlays} for overlays in (diagnosis.before, diagnosis.after))
    if channel not in before:
        return ()
    overlay, noise = before[channel], diagnosis.noise_rms[channel]
    counted = _counted_samples(diagnosis, overlay)
    residuals = [((o[channel].measured - o[channel].simulated) / noise)[counted] for o in (before, after)]
    if counted.sum() < _FEWEST:
        return ()
    shown = []
    for what, unit, values, equal in _respects(diagnosis, before, overlay):
        edges = edges_of(values[counted], BINS, equal=equal)
        shown.append(Profile(what, unit, edges, *(rms_in(edges, values[counted], r) for r in residuals)))
    return tuple(shown)


def _counted_samples(diagnosis: Diagnosis, overlay: Overlay) -> FloatArray:
    """Return which samples count: neither those before the bench has settled nor faulty ones."""
    out = np.asarray(diagnosis.masked.get(overlay.channel, np.zeros(len(overlay.t), bool)))
    good: FloatArray = (overlay.t >= overlay.t[0] + SKIPPED_START) & ~out
    return good


def _respects(
    diagnosis: Diagnosis, measured: Mapping[str, Overlay], overlay: Overlay
) -> Iterator[tuple[str, str, FloatArray, bool]]:
    """Yield name, unit, value at each sample, and whether bins are equally wide (else equally full)."""
    load = "ft" if "ft" in measured else "motor_torque"
    if load in measured:
        yield "amplitude", UNITS[load], np.abs(_at(overlay.t, measured[load])), False
    if "velocity" in measured:
        yield "velocity", UNITS["velocity"], _at(overlay.t, measured["velocity"]), False
    ratio = diagnosis.extended_rig["gear.ratio"]
    if "position" in measured and ratio > 1.0:
        yield "angle", "rad", np.mod(_at(overlay.t, measured["position"]) * ratio, 2.0 * np.pi), True
    yield "time", "s", overlay.t - overlay.t[0], True


def _at(t: FloatArray, overlay: Overlay) -> FloatArray:
    return np.interp(t, overlay.t, overlay.measured)


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
