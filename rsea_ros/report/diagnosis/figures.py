"""Figures of a diagnosis: the bench with culprits marked; the residual over frequency, time, load, speed."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from html import escape

import numpy as np

from rsea_ros.diagnosis.residual_analysis import edges_of, rms_in
from rsea_ros.diagnosis.result import Diagnosis, Spectrum
from rsea_ros.documents.wording import list_names
from rsea_ros.effects.catalogue import effect_named
from rsea_ros.effects.effect import Effect
from rsea_ros.effects.signal_table import Port
from rsea_ros.identification.result import Overlay
from rsea_ros.model.extent import SKIPPED_START
from rsea_ros.records.record import UNITS, FloatArray
from rsea_ros.report import words
from rsea_ros.report.diagnosis import words as say
from rsea_ros.report.figures import figure as fig
from rsea_ros.report.figures.figure import AFTER, BEFORE, Curve, Figure, band, faint
from rsea_ros.report.figures.overlay import overlay_figure
from rsea_ros.report.figures.spectrum import finding, in_bands, peak_above, residual_figure
from rsea_ros.report.page import Html


def spectrum_figure(diagnosis: Diagnosis, spectrum: Spectrum) -> Figure:
    """Return the residual's density before and after against the noise floor, the improvement shaded."""
    d, s, channel = diagnosis, spectrum, words.channel(spectrum.channel)
    if not d.causes:
        curves = [Curve("residual", AFTER if d.at_noise_floor else BEFORE, s.before)]
        title = finding(s.frequency, s.before, s.noise, channel)
        return residual_figure(title, s.channel, s.frequency, curves, s.noise)
    f, before = in_bands(s.frequency, s.before)
    _, after = in_bands(s.frequency, s.after)
    k, rest = int(np.argmax(before)), peak_above(s.frequency, s.after, s.noise)
    peak = f"{words.number(before[k] / s.noise, 2)} times the noise floor at {words.number(f[k], 2)} Hz"
    end = f"at most {rest}" if rest else "it is at the floor"
    causes = list_names([words.effect(c.name) for c in d.causes])
    they = "it" if len(d.causes) == 1 else "them"
    title = f"Without {causes} the residual is up to {peak}; with {they}, {end}"
    curves = [Curve("before", BEFORE, s.before), Curve("after", AFTER, s.after)]
    caption = f"Residual of the {channel}: measured minus simulated."
    figure = residual_figure(title, s.channel, s.frequency, curves, s.noise, caption)
    gained = band(f, np.minimum(after, before), before, faint(BEFORE, 0.10), name="gained")
    return replace(figure, data=[gained, *figure.data])


def time_figure(diagnosis: Diagnosis, channel: str) -> Figure:
    """Return the channel as measured and as simulated before and after, residuals beneath.

    With causes it opens where before and after differ most.
    """
    d = diagnosis
    before, after = (next(o for o in of if o.channel == channel) for of in (d.before, d.after))
    named = words.channel(channel), words.unit(UNITS[channel])
    name, fit = words.sentence(named[0]), f"{d.fit_percent[channel]:.2f} %"
    if not d.causes:
        simulated = Curve("simulated", AFTER if d.at_noise_floor else BEFORE, before.simulated)
        title = f"{name} over time: {fit} explained"
        return overlay_figure(title, *named, before.t, before.measured, [simulated])
    title = f"{name} over time: {fit} → {d.extended_fit_percent[channel]:.2f} % explained"
    both = [Curve("before", BEFORE, before.simulated), Curve("after", AFTER, after.simulated)]
    apart = before.simulated - after.simulated
    return overlay_figure(title, *named, before.t, before.measured, both, view=3.0, lively=apart)


_PARTS = ("command", "motor", "gear", "encoder", "spring", "F/T sensor", "support")
_OF_PORT = {
    Port.COMMAND: "motor", Port.MOTOR: "motor", Port.GEAR: "gear", Port.SPRING: "spring",
    Port.SENSOR: "F/T sensor", Port.STRUCTURE: "gear",
}  # fmt: skip


def sketch(causes: Sequence[str]) -> Html:
    """Return the parts of the bench in their order, culprits marked; page.css draws them in a row or, for
    phones, in a column. Empty without a cause. causes: names of effects, the largest first.
    """
    marked = {part_of(effect_named(name)): words.effect(name) for name in reversed(causes)}
    parts = (
        f'<li class="culprit"><b>{part}</b><small class="cause">{escape(marked[part])}</small></li>'
        if part in marked else f"<li><b>{part}</b></li>"
        for part in _PARTS
    )  # fmt: skip
    return Html(f'<ol class="sketch">{"".join(parts)}</ol>' if marked else "")


def part_of(effect: Effect) -> str:
    """Return the part of the bench that an effect sits in."""
    if effect.port == Port.SENSOR and effect.sensor == "position":
        return "encoder"
    return effect.part if effect.part in _PARTS else _OF_PORT[effect.port]


BINS = 16
_FEWEST = 4 * BINS
_DEPENDS = 1.5
_GAP = 0.035
_MARGIN, _MANY = 10.0**0.15, 10.0**2.5
"""Factors of the axis of levels: around the levels, and from which on it has a mark a decade."""


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
    """Return a profile over every signal that the record has.

    Neither samples before the bench has settled nor faulty ones count.
    """
    before, after = ({o.channel: o for o in overlays} for overlays in (diagnosis.before, diagnosis.after))
    if channel not in before:
        return ()
    o = before[channel]
    counted = (o.t >= o.t[0] + SKIPPED_START) & ~diagnosis.masked.get(channel, np.zeros(len(o.t), bool))
    if counted.sum() < _FEWEST:
        return ()
    noise = diagnosis.noise_rms[channel]
    left = [((of[channel].measured - of[channel].simulated) / noise)[counted] for of in (before, after)]
    shown = []
    for what, unit, values, equal in _respects(before, o, diagnosis.extended_rig["gear.ratio"]):
        edges = edges_of(values[counted], BINS, equal=equal)
        shown.append(Profile(what, unit, edges, *(rms_in(edges, values[counted], r) for r in left)))
    return tuple(shown)


def _respects(
    measured: Mapping[str, Overlay], overlay: Overlay, ratio: float
) -> Iterator[tuple[str, str, FloatArray, bool]]:
    """Yield name, unit, value at each sample, and whether bins are equally wide (else equally full)."""

    def at(name: str) -> FloatArray:
        return np.interp(overlay.t, measured[name].t, measured[name].measured)

    load = "ft" if "ft" in measured else "motor_torque"
    if load in measured:
        yield "amplitude", UNITS[load], np.abs(at(load)), False
    if "velocity" in measured:
        yield "velocity", UNITS["velocity"], at("velocity"), False
    if "position" in measured and ratio > 1.0:
        yield "angle", "rad", np.mod(at("position") * ratio, 2.0 * np.pi), True
    yield "time", "s", overlay.t - overlay.t[0], True


def where_figure(shown: Sequence[Profile], changed: bool, colour: str = fig.BEFORE) -> fig.Figure:
    """Return one panel for each respect, side by side.

    changed: whether to draw the residual with the causes too. colour: of the residual without them.
    """
    curves = [("before" if changed else "residual", colour), *([("after", fig.AFTER)] if changed else [])]
    width = (1.0 - _GAP * (len(shown) - 1)) / len(shown)
    data: list[fig.Json] = []
    axes: fig.Json = {"yaxis": _level_axis(shown)}
    for i, p in enumerate(shown):
        x, left = f"x{i + 1 if i else ''}", i * (width + _GAP)
        title = f"{say.respect(p.what)}, {words.unit(p.unit)}"
        axes[x.replace("x", "xaxis")] = fig.axis(title, domain=[left, min(left + width, 1.0)], nticks=5)
        place: fig.Json = {"xaxis": x, "yaxis": "y"}
        data.append(
            fig.line(p.edges[[0, -1]], np.ones(2), "noise", fig.NOISE, 6.0, hoverinfo="skip", **place)
        )
        for (name, shade), values in zip(curves, (p.before, p.after), strict=False):
            steps = np.append(values, values[-1])
            trace = fig.line(p.edges, steps, name, shade, 1.8, hovertemplate="%{y:.2f} times", **place)
            data.append({**trace, "line": {**trace["line"], "shape": "hv"}})
    names = fig.names_beside([*((f"<b>{name}</b>", c) for name, c in curves), ("noise", fig.QUIET)], 0.09)
    caption = "RMS of the residual over the noise. Bins of load and speed hold equally many samples."
    drawing = fig.layout(**axes, annotations=names, hovermode="closest")
    return fig.Figure(profile_finding(shown), caption, data, drawing, 320)


def profile_finding(shown: Sequence[Profile]) -> str:
    """Return a sentence on the signal that the residual depends on most, and where it is largest.

    Time comes last: in a sweep it is a proxy for the frequency.
    """
    physical = [p for p in shown if p.what != "time"]
    most = max(physical or shown, key=lambda p: p.contrast)
    if most.contrast >= _DEPENDS or not physical:
        return f"The residual depends most on {say.respect(most.what)}: {_extremes(most)}"
    alike = f"The residual is the same at every {list_names([say.respect(p.what) for p in physical], 'or')}"
    changing = [p for p in shown if p.what == "time" and p.contrast >= _DEPENDS]
    return f"{alike}; over time it changes: {_extremes(changing[0])}" if changing else alike


def _extremes(profile: Profile) -> str:
    k = int(np.nanargmax(profile.before))
    most, least = (words.number(v(profile.before), 2) for v in (np.nanmax, np.nanmin))
    where = words.span(float(profile.edges[k]), float(profile.edges[k + 1]), profile.unit)
    return f"{most} times the noise from {where}, {least} where it is least"


def _level_axis(shown: Sequence[Profile]) -> fig.Json:
    """Return the axis of all panels; 1, 2 and 5 of each decade stand as plain numbers.

    Zero (a sensor at rest) has no place on it.
    """
    levels = np.concatenate([[0.6, 3.0], *([p.before, p.after] for p in shown)], axis=None)
    values = levels[levels > 0.0]
    low, high = float(values.min()) / _MARGIN, float(values.max()) * _MARGIN
    return fig.log_axis("times the noise", low, high, (1,) if high > _MANY * low else (1, 2, 5))
