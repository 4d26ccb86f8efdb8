"""The report of a design: the result of the method, its gaps, and the designs that meet all demands."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from rsea_ros.design.spring_design import SpringDesign, by_train, least_for_band, rig_of, stiffness_bounds
from rsea_ros.model import outputs
from rsea_ros.model.transfer import end_to_end, frequency_response, undamped_stiffness
from rsea_ros.records.record import FloatArray
from rsea_ros.report import words
from rsea_ros.report.design.surface import Point, bandwidth_contours, log_marks
from rsea_ros.report.design.tables import checks_table, margins_table, springs_table, trains_table
from rsea_ros.report.figures import figure as fig
from rsea_ros.report.figures.response_curves import Mark, ResponseCurve, response_figure
from rsea_ros.report.page import Block, Html, equation, key_numbers, page, section
from rsea_ros.report.result_files import Provenance

_COLOURS = (fig.BEFORE, fig.AFTER, fig.TRUTH)
_MARKS = (0.2, 0.5, 1, 2, 5, 10, 20)
_TOP = 2e4
"""N·m/rad, upper end of the map of feasible designs."""


def design_report(
    asked: SpringDesign,
    least: SpringDesign,
    robust: SpringDesign | None,
    provenance: Provenance | None = None,
) -> str:
    """Return the page. asked: the stiffness judged; least: meets all demands; robust: under tolerance too."""
    r, unit = asked.requirement, asked.unit
    sources = [f"train {words.train(unit.train)} ({unit.sources['train']})"]
    sources += [f"{k.replace('_', ' ')} {v:g} ({unit.sources[k]})" for k, v in unit.values.items()]
    footer = [
        f"{unit.name}: {'; '.join(sources)}",
        "Damping of spring and chassis: ratio 0.025, assumed.",
        "rsea design. All values in SI.",
    ]
    demands = f"{r.torque:g} N·m, {r.bandwidth:g} Hz, {math.degrees(r.deflection):g}°"
    kicker = f"Design for {demands} · {unit.about or unit.name}"
    return page(verdict(asked), kicker, _blocks(asked, least, robust), footer, provenance)


def _blocks(asked: SpringDesign, least: SpringDesign, robust: SpringDesign | None) -> Iterator[Block]:
    designs = [asked, least, *([robust] if robust else [])]
    turned = "none" if math.isnan(asked.deflection) else f"{math.degrees(asked.deflection):.1f}°"
    yield key_numbers([
        (f"{asked.band_eq_7:.1f} Hz", "bandwidth by Eq. (7)"),
        (_hz(asked.band_exact), "with the rotor's spin"),
        (f"{asked.stiffness / 2:.0f} N·m", "largest torque by Eq. (8)"),
        (turned, f"at {asked.requirement.torque:.0f} N·m by Eq. (8)"),
        (f"{math.degrees(asked.linear):.0f}°", "as if linear"),
    ])  # fmt: skip
    yield _method(asked, least)
    yield checks_table(designs)
    yield trains_table(by_train(asked.requirement, asked.unit, asked.stiffness), asked)
    yield _map(designs)
    yield _surface(asked)
    yield _open_loop(designs)
    yield springs_table(designs)
    yield margins_table(asked if robust is None else robust)


def verdict(d: SpringDesign) -> str:
    """Return in a sentence which demands the design meets."""
    unmet = sum(not c.met for c in d.checks)
    spring = f"{d.stiffness:.0f} N·m/rad"
    if not unmet:
        turned = f"{math.degrees(d.deflection):.1f}° at {d.requirement.torque:.0f} N·m"
        return f"{spring} meet every demand: {_hz(d.band_exact)}, {turned}"
    return f"{spring} reach {d.band_eq_7:.1f} Hz by Eq. (7), but miss {unmet} of {len(d.checks)} demands"


def _hz(value: float) -> str:
    return words.hertz(value) + (" Hz" if math.isfinite(value) else "")


def _method(asked: SpringDesign, least: SpringDesign) -> Html:
    r, spin = asked.requirement, 1e3 * asked.unit.spin
    signed = f"{'−' if spin < 0.0 else '+'} {abs(spin):.3f}"
    turns, train = words.signed_text(asked.unit.turns, 0), words.train(asked.unit.train)
    bounds = stiffness_bounds(least.requirement, least.unit).items()
    why = "; ".join(f"{words.sentence(name)} asks for {value:.0f}" for name, value in bounds)
    return section(
        "Result of the method, and its gaps",
        equation(
            f"Eq. (7)   K_s = {asked.stiffness:.0f} N·m/rad, f = √(0.292 K_s / J_sc) / 2π = "
            f"{asked.band_eq_7:.1f} Hz\n"
            f"Eq. (8)   T ≤ K_s / 2 = {asked.stiffness / 2:.0f} N·m at 45°, {r.torque:.0f} N·m asked for\n"
            f"linear    T / K_s = {asked.linear:.2f} rad = {math.degrees(asked.linear):.0f}°, "
            f"{math.degrees(r.deflection):.0f}° allowed\n"
            f"spin      J_sc + n J_r = {1e3 * r.inertia:.3f} {signed} g·m²  →  "
            f"{_hz(asked.band_exact)}   ({train}, n = {turns})"
        ),
        f"The least stiffness that meets all demands on the spring is {least.stiffness:.0f} N·m/rad with "
        f"this motor and gear: {why}.",
    )


def _map(designs: Sequence[SpringDesign]) -> fig.Figure:
    r, unit = designs[0].requirement, designs[0].unit
    j, bounds = np.geomspace(2e-4, 2e-2, 25), stiffness_bounds(r, unit)
    lines = {
        f"{r.bandwidth:g} Hz, with spin": np.array(
            [least_for_band(replace(r, inertia=float(v)), unit) for v in j]
        ),
        f"{math.degrees(r.deflection):g}° at {r.torque:g} N·m": bounds["Deflection"] * np.ones(len(j)),
        f"K_s/2 = {r.torque:g} N·m": bounds["Torque, K_s/2"] * np.ones(len(j)),
        f"{r.bandwidth:g} Hz, Eq. (7)": undamped_stiffness(r.bandwidth, j),
    }
    least = np.max(list(lines.values()), axis=0)
    hidden: fig.Json = {"hoverinfo": "skip", "line": {"width": 0}}
    hover: fig.Json = {"hovertemplate": "%{y:.0f} N·m/rad"}
    data: list[fig.Json] = [
        fig.line(1e3 * j, np.full(len(j), _TOP), "", fig.TRUTH, **hidden),
        fig.line(
            1e3 * j, least, "", fig.TRUTH, fill="tonexty", fillcolor=fig.faint(fig.TRUTH, 0.12), **hidden
        ),
    ]
    middle = float(np.log10(1e3 * j[len(j) // 3]))
    names = [fig.label("<b>meets all demands</b>", middle, float(np.log10(0.6 * _TOP)), fig.TRUTH)]
    for (name, k), colour in zip(lines.items(), (fig.BEFORE, fig.INK, fig.QUIET, fig.AFTER), strict=True):
        data.append(fig.line(1e3 * j, k, name, colour, **hover))
        names.append(fig.label(name, 1.01, float(np.log10(k[-1])), colour, xref="paper"))
    for d, colour in zip(designs, _COLOURS, strict=False):
        x, k_s = 1e3 * r.inertia, d.stiffness
        data.append(fig.points([x], [k_s], f"{k_s:.0f}", marker={"size": 10, "color": colour}, **hover))
        at = float(np.log10(x)), float(np.log10(k_s))
        names.append(fig.label(f"<b>{k_s:.0f}</b>", *at, colour, xshift=8, yshift=-11))
    alone = f"{float(undamped_stiffness(r.bandwidth, unit.spin)):.0f} N·m/rad"
    title = (
        f"A chassis without mass needs {alone} for {r.bandwidth:g} Hz; a heavier one less, until it cancels "
        f"the rotor's spin at {1e3 * abs(unit.spin):.1f} g·m²"
    )
    if unit.spin > 0.0:
        title = (
            f"However light the chassis, {r.bandwidth:g} Hz need {alone} with this rotor: Eq. (7) considers "
            "only the chassis"
        )
    plane = fig.layout(
        xaxis=fig.axis("spring chassis inertia J_sc, g·m²", type="log", **log_marks(*_MARKS)),
        yaxis=fig.axis(
            "stiffness K_s, N·m/rad", type="log", range=[float(np.log10(v)) for v in (50.0, _TOP)],
            **log_marks(100, 200, 500, 1000, 2000, 5000, 10000),
        ),
        annotations=names, hovermode="closest", margin={"l": 72, "r": 210, "t": 12, "b": 48},
    )  # fmt: skip
    caption = "A design meets a demand above its line. Eq. (7) is the only one that the paper draws."
    return fig.Figure(title, caption, data, plane, 460)


def _surface(d: SpringDesign) -> fig.Figure:
    k = d.stiffness
    shown = [
        Point(f"{k:.0f} N·m/rad, chassis", k, d.requirement.inertia, fig.AFTER),
        Point("the same with the rotor's spin", k, d.inner, fig.BEFORE, "bottom center"),
    ]
    title = "Bandwidth by Eq. (7) over stiffness and inertia (Fig. 9)"
    caption = "Both axes are logarithmic; lines of equal bandwidth every 20 Hz."
    return bandwidth_contours(title, shown, caption)


def _open_loop(designs: Sequence[SpringDesign]) -> fig.Figure:
    hz: FloatArray = np.geomspace(0.5, 300.0, 500)
    curves = []
    for d, colour in zip(designs, _COLOURS, strict=False):
        rig = rig_of(d.requirement, d.unit, d.stiffness)
        motor = frequency_response(rig, outputs.end_torque(rig, "spring_end"), hz)
        curves.append(
            ResponseCurve(f"{d.stiffness:.0f}: T_d/T_p", colour, hz, end_to_end(rig)(2j * np.pi * hz))
        )
        curves.append(ResponseCurve(f"{d.stiffness:.0f}: T_d/T_m", colour, hz, motor, 1.2, "dot"))
    first = designs[0]
    between = f"fall below −3 dB at {_hz(first.band_exact)}, without a resonance"
    if first.inner > 0.0:
        between = f"resonate at {first.resonance:.1f} Hz"
    title = (
        f"Between the ends {first.stiffness:.0f} N·m/rad {between}; the motor itself, with its reflected "
        "inertia, reaches less"
    )
    caption = (
        "Solid: end to end, the pure-torque criterion. Dotted: open loop from the motor, both ends clamped."
    )
    asked = first.requirement.bandwidth
    return response_figure(
        title, curves, [Mark(asked, f"{asked:g} Hz asked for")], caption, decibel=(-60.0, 40.0)
    )
