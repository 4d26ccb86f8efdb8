"""A design in tables: demands, trains, springs, margins; and design.json."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from rsea_ros.design.spring_design import (
    Check,
    Margin,
    SpringDesign,
    WithTrain,
    by_train,
    margins,
    sense_unknown,
    spreads_of,
    spring_design,
    stiffness_bounds,
)
from rsea_ros.records.statistics import Z90
from rsea_ros.report import words
from rsea_ros.report.page import Html, listed, section, table
from rsea_ros.report.result_files import pick


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
        ("Train", lambda row: words.train(row.train)),
        ("#n", lambda row: words.signed_text(row.turns, 0)),
        ("#J_sc + n J_r, g·m²", lambda row: words.signed_text(1e3 * row.inner, 2)),
        (f"#±3 dB with K_s = {d.stiffness:.0f}, Hz", lambda row: words.hertz(row.band)),
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
    unknown, known = (
        "The sense of rotation is not known: both are shown",
        "Effect of the rotor's spin on the band",
    )
    return section(unknown if sense_unknown(rows) else known, shown, caption=caption)


def springs_table(designs: Sequence[SpringDesign]) -> Html:
    """Return the rate of one spring at several separations."""
    r, short, rows = designs[0].requirement, 100.0 * designs[0].error, []
    for separation in sorted({r.separation, 0.0762, 0.1016}):
        if separation <= r.diameter:
            varied = replace(r, separation=separation)
            rates = (spring_design(varied, d.unit, d.stiffness).rate for d in designs)
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

    rows = margins(d)
    spreads = ", ".join(f"{name.replace('_', ' ')} {100 * s:g} %" for name, s in spreads_of(d.unit).items())
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
        "train turns inner_inertia=inner bandwidth_exact_hz=band "
        "bandwidth_hz_90_percent_of_rotor_inertia=band_range least_stiffness_for_bandwidth=for_band "
        "least_stiffness=least"
    )
    return {
        "schema": 1, **pick(asked, "requirement unit=unit.name train=unit.train"),
        "by_train": [pick(row, train) for row in by_train(r, asked.unit, asked.stiffness)],
        "least_stiffness_by_demand": stiffness_bounds(r, asked.unit), "asked": _design(asked),
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
        "margins": [pick(m, "name percentiles_5_50_95=percentiles limit share") for m in margins(d)],
    }
