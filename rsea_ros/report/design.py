"""A design by the paper's method: the result, its gaps, the designs that meet all demands; design.json."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from rsea_ros.design import spring_design as springs
from rsea_ros.design.spring_design import Check, Margin, SpringDesign, WithTrain
from rsea_ros.model.transfer import end_response, end_to_end, undamped_stiffness
from rsea_ros.records.record import FloatArray
from rsea_ros.records.statistics import Z90
from rsea_ros.report import words
from rsea_ros.report.figures import figure as fig
from rsea_ros.report.figures.response import Mark, ResponseCurve, response_figure
from rsea_ros.report.page import Block, Html, equation, key_numbers, listed, page, section, table
from rsea_ros.report.result_files import Provenance, pick

_COLOURS = (fig.BEFORE, fig.AFTER, fig.TRUTH)
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
    yield trains_table(springs.by_train(asked.requirement, asked.unit, asked.stiffness), asked)
    yield _map(designs)
    yield _open_loop(designs)
    yield springs_table(designs)
    yield margins_table(asked if robust is None else robust)


def whole(value: float) -> str:
    """Return a number without decimals where three digits remain, `461`, `1728`, `0.3`."""
    return f"{value:.0f}" if value >= 10.0 else f"{value:.3g}"


def verdict(d: SpringDesign) -> str:
    """Return in a sentence which demands the design meets."""
    unmet = sum(not c.met for c in d.checks)
    spring = f"{whole(d.stiffness)} N·m/rad"
    if not unmet:
        turned = f"{math.degrees(d.deflection):.1f}° at {whole(d.requirement.torque)} N·m"
        return f"{spring} meet every demand: {_hz(d.band_exact)}, {turned}"
    return f"{spring} reach {d.band_eq_7:.1f} Hz by Eq. (7), but miss {unmet} of {len(d.checks)} demands"


def _hz(value: float) -> str:
    return words.hertz(value) + (" Hz" if math.isfinite(value) else "")


def _method(asked: SpringDesign, least: SpringDesign) -> Html:
    r, spin = asked.requirement, 1e3 * asked.unit.spin
    signed = f"{'−' if spin < 0.0 else '+'} {abs(spin):.3f}"
    turns, train = words.signed_text(asked.unit.turns, 0), words.train(asked.unit.train)
    bounds = springs.stiffness_bounds(least.requirement, least.unit).items()
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
    j, bounds = np.geomspace(2e-4, 2e-2, 25), springs.stiffness_bounds(r, unit)
    lines = {
        f"{r.bandwidth:g} Hz, with spin": np.array(
            [springs.least_for_band(replace(r, inertia=float(v)), unit) for v in j]
        ),
        f"{math.degrees(r.deflection):g}° at {r.torque:g} N·m": bounds["Deflection"] * np.ones(len(j)),
        f"K_s/2 = {r.torque:g} N·m": bounds["Torque, K_s/2"] * np.ones(len(j)),
        f"{r.bandwidth:g} Hz, Eq. (7)": undamped_stiffness(r.bandwidth, j),
    }
    least = np.max(list(lines.values()), axis=0)
    hover: fig.Json = {"hovertemplate": "%{y:.0f} N·m/rad"}
    data = [fig.band(1e3 * j, least, np.full(len(j), _TOP), fig.faint(fig.TRUTH, 0.12))]
    middle = float(np.log10(1e3 * j[len(j) // 3]))
    names = [fig.label("<b>meets all demands</b>", middle, float(np.log10(0.6 * _TOP)), fig.TRUTH)]
    for (name, k), colour in zip(lines.items(), (fig.BEFORE, fig.INK, fig.QUIET, fig.AFTER), strict=True):
        data.append(fig.line(1e3 * j, k, name, colour, **hover))
        names.append(fig.label(name, 1.01, float(np.log10(k[-1])), colour, xref="paper"))
    for d, colour in zip(designs, _COLOURS, strict=False):
        x, k_s = 1e3 * r.inertia, d.stiffness
        data.append(fig.points([x], [k_s], f"{k_s:.0f}", colour, 10, **hover))
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
        xaxis=fig.log_axis("spring chassis inertia J_sc, g·m²", 1e3 * j[0], 1e3 * j[-1]),
        yaxis=fig.log_axis("stiffness K_s, N·m/rad", 50.0, _TOP),
        annotations=names, hovermode="closest", margin={"l": 72, "r": 210, "t": 12, "b": 48},
    )  # fmt: skip
    caption = "A design meets a demand above its line. Eq. (7) is the only one that the paper draws."
    return fig.Figure(title, caption, data, plane, 460)


def _open_loop(designs: Sequence[SpringDesign]) -> fig.Figure:
    hz: FloatArray = np.geomspace(0.5, 300.0, 500)
    curves = []
    for d, colour in zip(designs, _COLOURS, strict=False):
        rig = springs.rig_of(d.requirement, d.unit, d.stiffness)
        motor = end_response(rig, hz)
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


def checks_table(designs: Sequence[SpringDesign]) -> Html:
    """Return which design meets which demand."""

    def cell(check: Check) -> str:
        number = f"{words.number(check.value)} {words.unit(check.unit)}"
        return f"{'✓' if check.met else '✗'} {'not possible' if math.isnan(check.value) else number}"

    rows = []
    for check, *others in zip(*(d.checks for d in designs), strict=True):
        limit = f"{'≥' if check.least else '≤'} {words.number(check.limit)} {words.unit(check.unit)}"
        rows.append([check.name, limit, *map(cell, (check, *others))])
    met = sum(d.feasible for d in designs)
    finding = "No design meets all demands: the motor is too weak"
    if met:
        finding = f"{met} of {len(designs)} designs meet all demands"
    return section(
        finding, table(["Demand", "#Limit", *(f"#K_s = {d.stiffness:.0f} N·m/rad" for d in designs)], rows)
    )


def trains_table(rows: Sequence[WithTrain], d: SpringDesign) -> Html:
    """Return the design with every possible train of the unit, and the range left by J_m."""
    shown = listed(
        rows,
        ("Train", lambda row: words.train(row.design.unit.train)),
        ("#n", lambda row: words.signed_text(row.design.unit.turns, 0)),
        ("#J_sc + n J_r, g·m²", lambda row: words.signed_text(1e3 * row.design.inner, 2)),
        (f"#±3 dB with K_s = {d.stiffness:.0f}, Hz", lambda row: words.hertz(row.design.band_exact)),
        ("#90 % of J_m, Hz", lambda row: " to ".join(words.hertz(v) for v in row.band_range)),
        (f"#K_s for {d.requirement.bandwidth:g} Hz, N·m/rad", lambda row: f"{row.for_band:.0f}"),
        ("#K_s for all demands", lambda row: f"{row.least:.0f}"),
    )
    spread, factor = 100.0 * d.unit.rotor_spread, math.exp(Z90 * d.unit.rotor_spread)
    caption = (
        f"J_m = {d.unit['reflected_inertia']:g} kg·m² within {spread:.0f} % (one sigma, log-normal: 90 % "
        f"from 1/{factor:.2f} to {factor:.2f} times). A rotor that turns against the output takes its spin "
        "from the chassis' inertia: below zero T_d/T_p falls without a resonance, and a heavier chassis "
        f"widens the band. Train: {d.unit.sources['train']}."
    )
    title = "Effect of the rotor's spin on the band"
    if len({row.design.unit.turns > 0.0 for row in rows}) > 1:
        title = "The sense of rotation is not known: both are shown"
    return section(title, shown, caption=caption)


def springs_table(designs: Sequence[SpringDesign]) -> Html:
    """Return the rate of one spring at several separations."""
    r, short, rows = designs[0].requirement, 100.0 * designs[0].error, []
    for separation in sorted({r.separation, 0.0762, 0.1016}):
        if separation <= r.diameter:
            varied = replace(r, separation=separation)
            rates = (springs.spring_design(varied, d.unit, d.stiffness).rate for d in designs)
            travel = 0.5 * separation * math.sin(r.deflection)
            ends = words.number(1e3 * separation), words.number(1e3 * travel)
            rows.append([ends[0], *(f"{v / 1e3:.0f}" for v in rates), ends[1]])
    head = ["#Separation, mm", *(f"#for {d.stiffness:.0f} N·m/rad" for d in designs), "#travel, mm"]
    return section(
        "Rate of one spring, N/mm: a wider separation makes the same joint from softer springs",
        table(head, rows),
        caption=f"Eq. (9) inverted, r_s = {1e3 * r.spring_radius:.1f} mm. Travel at "
        f"{math.degrees(r.deflection):g}°, where the sin·cos law of Eq. (8) falls {short:.2f} % short of "
        "linear.",
    )


def margins_table(d: SpringDesign) -> Html:
    """Return which share of actuators meets the demands with parts that scatter."""

    def row(m: Margin) -> list[str]:
        unit, share = words.unit(m.unit), f"{100 * m.share:.1f} %"
        if math.isnan(m.limit):
            return [m.name, "", "", "", "", share]
        values = ["not possible" if math.isinf(v) else f"{words.number(v)} {unit}" for v in m.percentiles]
        return [m.name, *values, f"{words.number(m.limit)} {unit}", share]

    rows = springs.margins(d)
    spreads = ", ".join(
        f"{name.replace('_', ' ')} {100 * s:g} %" for name, s in springs.spreads_of(d.unit).items()
    )
    return section(
        f"With parts that scatter, {100 * rows[-1].share:.0f} % of the actuators with {d.stiffness:.0f} "
        "N·m/rad meet all demands",
        table(["Quantity", "#5 %", "#median", "#95 %", "#limit", "#meets it"], map(row, rows)),
        caption=f"One sigma, relative: {spreads}. 20 000 draws.",
    )


def design_json(asked: SpringDesign, least: SpringDesign, robust: SpringDesign | None) -> dict[str, Any]:
    """Return the result file. Angles in rad; null where a design cannot carry the torque."""
    r = asked.requirement
    train = (
        "train=design.unit.train turns=design.unit.turns inner_inertia=design.inner "
        "bandwidth_exact_hz=design.band_exact bandwidth_hz_90_percent_of_rotor_inertia=band_range "
        "least_stiffness_for_bandwidth=for_band least_stiffness=least"
    )
    return {
        "schema": 1, **pick(asked, "requirement unit=unit.name train=unit.train"),
        "by_train": [pick(row, train) for row in springs.by_train(r, asked.unit, asked.stiffness)],
        "least_stiffness_by_demand": springs.stiffness_bounds(r, asked.unit), "asked": _design(asked),
        "least": _design(least), "robust": _design(robust) if robust else None,
    }  # fmt: skip


def _design(d: SpringDesign) -> dict[str, Any]:
    return {
        **pick(d, "stiffness spring_rate=rate arm=requirement.arm"),
        "largest_torque": 0.5 * d.stiffness,
        **pick(
            d,
            "deflection linear_deflection=linear linearity_error_at_limit=error inner_inertia=inner "
            "resonance_hz=resonance bandwidth_eq_7_hz=band_eq_7 bandwidth_exact_hz=band_exact feasible",
        ),
        "checks": [pick(c, "name value limit unit met") for c in d.checks],
        "margins": [pick(m, "name percentiles_5_50_95=percentiles limit share") for m in springs.margins(d)],
    }
