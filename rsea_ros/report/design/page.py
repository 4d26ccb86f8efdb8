"""The report of a design: the result of the method, its gaps, and the designs that meet all demands."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from html import escape

import numpy as np

from rsea_ros.design.by_train import by_train
from rsea_ros.design.spring_design import SpringDesign, least_for_band, rig_of, stiffness_bounds
from rsea_ros.model import outputs
from rsea_ros.model.bandwidth import end_to_end, undamped_stiffness
from rsea_ros.model.transfer import frequency_response
from rsea_ros.records.record import FloatArray
from rsea_ros.report import words
from rsea_ros.report.design.map import LeastStiffness, feasible_map
from rsea_ros.report.design.surface import Point, bandwidth_contours
from rsea_ros.report.design.tables import (
    checks_table,
    margins_table,
    springs_table,
    trains_table,
)
from rsea_ros.report.figures.figure import Figure
from rsea_ros.report.figures.palette import AFTER, BEFORE, INK, QUIET, TRUTH
from rsea_ros.report.figures.response_curves import Mark, ResponseCurve, response_figure
from rsea_ros.report.page.frame import Block, page
from rsea_ros.report.page.html import equation, key_numbers, section
from rsea_ros.report.provenance import Provenance

_COLOURS = (BEFORE, AFTER, TRUTH)


def design_report(
    asked: SpringDesign,
    least: SpringDesign,
    robust: SpringDesign | None,
    provenance: Provenance | None = None,
) -> str:
    """Return the page. asked: the stiffness judged; least: meets all demands; robust: under tolerance too."""
    designs = [asked, least, *([robust] if robust else [])]
    blocks: list[Block] = [
        key_numbers(_keys(asked)),
        _sentences(asked, least),
        checks_table(designs),
        trains_table(by_train(asked.requirement, asked.unit, asked.stiffness), asked),
        _map(designs),
        bandwidth_contours(*_surface(designs)),
        _open_loop(designs),
        springs_table(designs),
        margins_table(asked if robust is None else robust),
    ]
    footer = [*_footer(asked), *(provenance.lines if provenance else ())]
    return page(verdict(asked), _kicker(asked), blocks, footer)


def verdict(d: SpringDesign) -> str:
    """Return in a sentence which demands the design meets."""
    unmet = [c for c in d.checks if not c.met]
    spring = f"{d.stiffness:.0f} N·m/rad"
    if not unmet:
        turned = f"{math.degrees(d.deflection):.1f}° at {d.requirement.torque:.0f} N·m"
        return f"{spring} meet every demand: {_hz(d.band_exact)}, {turned}"
    band = f"{spring} reach {d.band_eq_7:.1f} Hz by Eq. (7)"
    return f"{band}, but miss {len(unmet)} of {len(d.checks)} demands"


def _kicker(d: SpringDesign) -> str:
    r = d.requirement
    return (
        f"Design for {r.torque:g} N·m, {r.bandwidth:g} Hz, {math.degrees(r.deflection):g}° · "
        f"{d.unit.about or d.unit.name}"
    )


def _keys(d: SpringDesign) -> list[tuple[str, str]]:
    turned = "none" if math.isnan(d.deflection) else f"{math.degrees(d.deflection):.1f}°"
    return [
        (f"{d.band_eq_7:.1f} Hz", "bandwidth by Eq. (7)"),
        (_hz(d.band_exact), "with the rotor's spin"),
        (f"{d.stiffness / 2:.0f} N·m", "largest torque by Eq. (8)"),
        (turned, f"at {d.requirement.torque:.0f} N·m by Eq. (8)"),
        (f"{math.degrees(d.linear):.0f}°", "as if linear"),
    ]


def _sentences(asked: SpringDesign, least: SpringDesign) -> str:
    r = asked.requirement
    spin, turns = asked.unit.spin, words.signed_text(asked.unit.turns, 0)
    return section(
        "Result of the method, and its gaps",
        equation(
            f"Eq. (7)   K_s = {asked.stiffness:.0f} N·m/rad, f = √(0.292 K_s / J_sc) / 2π = "
            f"{asked.band_eq_7:.1f} Hz\n"
            f"Eq. (8)   T ≤ K_s / 2 = {asked.stiffness / 2:.0f} N·m at 45°, {r.torque:.0f} N·m asked for\n"
            f"linear    T / K_s = {asked.linear:.2f} rad = {math.degrees(asked.linear):.0f}°, "
            f"{math.degrees(r.deflection):.0f}° allowed\n"
            f"spin      J_sc + n J_r = {1e3 * r.inertia:.3f} {_term(1e3 * spin)} g·m²  →  "
            f"{_hz(asked.band_exact)}   ({words.train(asked.unit.train)}, n = {turns})"
        ),
        f"<p>The least stiffness that meets all demands on the spring is <b>{least.stiffness:.0f} N·m/rad</b>"
        f" with this motor and gear: {escape(_why(least))}.</p>",
    )


def _hz(value: float) -> str:
    return words.hertz(value) + (" Hz" if math.isfinite(value) else "")


def _term(value: float) -> str:
    return f"{'−' if value < 0.0 else '+'} {abs(value):.3f}"


def _why(least: SpringDesign) -> str:
    bounds = stiffness_bounds(least.requirement, least.unit)
    parts = [f"{words.sentence(name)} asks for {value:.0f}" for name, value in bounds.items()]
    return "; ".join(parts)


def _map(designs: Sequence[SpringDesign]) -> Figure:
    r, unit = designs[0].requirement, designs[0].unit
    j = np.geomspace(2e-4, 2e-2, 25)
    bounds = stiffness_bounds(r, unit)
    spin = np.array([least_for_band(replace(r, inertia=float(v)), unit) for v in j])
    flat = np.ones(len(j))
    demands = [
        LeastStiffness(f"{r.bandwidth:g} Hz, with spin", BEFORE, j, spin),
        LeastStiffness(
            f"{math.degrees(r.deflection):g}° at {r.torque:g} N·m", INK, j, bounds["Deflection"] * flat
        ),
        LeastStiffness(f"K_s/2 = {r.torque:g} N·m", QUIET, j, bounds["Torque, K_s/2"] * flat),
        LeastStiffness(f"{r.bandwidth:g} Hz, Eq. (7)", AFTER, j, undamped_stiffness(r.bandwidth, j)),
    ]
    points = [
        Point(f"{d.stiffness:.0f}", d.stiffness, r.inertia, c)
        for d, c in zip(designs, _COLOURS, strict=False)
    ]
    caption = "A design meets a demand above its line. Eq. (7) is the only one that the paper draws."
    return feasible_map(_map_title(designs[0]), points, demands, caption)


def _map_title(d: SpringDesign) -> str:
    r, spin = d.requirement, d.unit.spin
    alone = float(undamped_stiffness(r.bandwidth, spin))
    if spin > 0.0:
        return (
            f"However light the chassis, {r.bandwidth:g} Hz need {alone:.0f} N·m/rad with this rotor: "
            "Eq. (7) considers only the chassis"
        )
    return (
        f"A chassis without mass needs {alone:.0f} N·m/rad for {r.bandwidth:g} Hz; a heavier one less, "
        f"until it cancels the rotor's spin at {1e3 * abs(spin):.1f} g·m²"
    )


def _surface(designs: Sequence[SpringDesign]) -> tuple[str, list[Point], str]:
    d = designs[0]
    points = [
        Point(f"{d.stiffness:.0f} N·m/rad, chassis", d.stiffness, d.requirement.inertia, AFTER),
        Point("the same with the rotor's spin", d.stiffness, d.inner, BEFORE, "bottom center"),
    ]
    title = "Bandwidth by Eq. (7) over stiffness and inertia (Fig. 9)"
    return title, points, "Both axes are logarithmic; lines of equal bandwidth every 20 Hz."


def _open_loop(designs: Sequence[SpringDesign]) -> Figure:
    hz: FloatArray = np.geomspace(0.5, 300.0, 500)
    curves = []
    for d, colour in zip(designs, _COLOURS, strict=False):
        rig = rig_of(d.requirement, d.unit, d.stiffness)
        motor = frequency_response(rig, outputs.end_torque(rig, "spring_end"), hz)
        ends = end_to_end(rig)(2j * np.pi * hz)
        curves.append(ResponseCurve(f"{d.stiffness:.0f}: T_d/T_p", colour, hz, ends))
        curves.append(ResponseCurve(f"{d.stiffness:.0f}: T_d/T_m", colour, hz, motor, 1.2, "dot"))
    first = designs[0]
    between = (
        f"resonate at {first.resonance:.1f} Hz"
        if first.inner > 0.0
        else f"fall below −3 dB at {_hz(first.band_exact)}, without a resonance"
    )
    title = (
        f"Between the ends {first.stiffness:.0f} N·m/rad {between}; the motor itself, with its reflected "
        "inertia, reaches less"
    )
    caption = (
        "Solid: end to end, the pure-torque criterion. Dotted: open loop from the motor, both ends clamped."
    )
    marks = [Mark(designs[0].requirement.bandwidth, f"{designs[0].requirement.bandwidth:g} Hz asked for")]
    return response_figure(title, curves, marks, caption, decibel=(-60.0, 40.0))


def _footer(d: SpringDesign) -> list[str]:
    sources = [f"train {words.train(d.unit.train)} ({d.unit.sources['train']})"]
    sources += [f"{k.replace('_', ' ')} {v:g} ({d.unit.sources[k]})" for k, v in d.unit.values.items()]
    return [
        f"{d.unit.name}: {'; '.join(sources)}",
        "Damping of spring and chassis: ratio 0.025, assumed.",
        "rsea design. All values in SI.",
    ]
