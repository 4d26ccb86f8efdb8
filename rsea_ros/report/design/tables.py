"""The tables of a design's page: demands, springs, margins."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from rsea_ros.design.by_train import WithTrain, sense_unknown
from rsea_ros.design.spring_design import Check, SpringDesign, spring_design
from rsea_ros.design.tolerance import Margin, margins, spreads_of
from rsea_ros.records.statistics import Z90
from rsea_ros.report import words
from rsea_ros.report.page.html import section
from rsea_ros.report.page.html_table import table


def checks_table(designs: Sequence[SpringDesign]) -> str:
    head = ["Demand", "Limit", *(f"K_s = {d.stiffness:.0f} N·m/rad" for d in designs)]
    rows = []
    for i, check in enumerate(designs[0].checks):
        sign = "≥" if check.least else "≤"
        limit = f"{sign} {words.number(check.limit)} {words.unit(check.unit)}"
        rows.append([check.name, limit, *(_cell(d.checks[i]) for d in designs)])
    met = [d for d in designs if d.feasible]
    finding = (
        f"{len(met)} of {len(designs)} designs meet all demands"
        if met
        else "No design meets all demands: the motor is too weak"
    )
    return section(finding, table(head, rows, numbers=range(1, len(head))))


def _cell(check: Check) -> str:
    number = f"{words.number(check.value)} {words.unit(check.unit)}"
    value = "not possible" if math.isnan(check.value) else number
    return f"{'✓' if check.met else '✗'} {value}"


def trains_table(rows: Sequence[WithTrain], d: SpringDesign) -> str:
    """Return the design with every possible train of the unit, and the range left by J_m."""
    hz = d.requirement.bandwidth
    head = [
        "Train",
        "n",
        "J_sc + n J_r, g·m²",
        f"±3 dB with K_s = {d.stiffness:.0f}, Hz",
        "90 % of J_m, Hz",
        f"K_s for {hz:g} Hz, N·m/rad",
        "K_s for all demands",
    ]
    body = [
        [
            words.train(row.train),
            words.signed_text(row.turns, 0),
            words.signed_text(1e3 * row.inner, 2),
            words.hertz(row.band),
            " to ".join(words.hertz(v) for v in row.band_range),
            f"{row.for_band:.0f}",
            f"{row.least:.0f}",
        ]
        for row in rows
    ]
    spread, factor = 100.0 * d.unit.rotor_spread, math.exp(Z90 * d.unit.rotor_spread)
    caption = (
        f"J_m = {d.unit['reflected_inertia']:g} kg·m² within {spread:.0f} % (one sigma, log-normal: 90 % "
        f"from 1/{factor:.2f} to {factor:.2f} times). A rotor that turns against the output takes its spin "
        "from the chassis' inertia: below zero T_d/T_p falls without a resonance, and a heavier chassis "
        f"widens the band. Train: {d.unit.sources['train']}."
    )
    title = (
        "The sense of rotation is not known: both are shown"
        if sense_unknown(rows)
        else "Effect of the rotor's spin on the band"
    )
    return section(title, table(head, body, numbers=range(1, 7)), caption=caption)


def springs_table(designs: Sequence[SpringDesign]) -> str:
    r = designs[0].requirement
    head = [
        "Separation, mm",
        *(f"for {d.stiffness:.0f} N·m/rad" for d in designs),
        "travel, mm",
    ]
    rows = []
    for separation in sorted({r.separation, 0.0762, 0.1016}):
        if separation > r.diameter:
            continue
        varied = replace(r, separation=separation)
        rates = [spring_design(varied, d.unit, d.stiffness).rate for d in designs]
        travel = 0.5 * separation * math.sin(r.deflection)
        rows.append(
            [words.number(1e3 * separation), *(f"{v / 1e3:.0f}" for v in rates), words.number(1e3 * travel)]
        )
    short = 100.0 * designs[0].error
    caption = (
        f"Eq. (9) inverted, r_s = {1e3 * r.spring_radius:.1f} mm. Travel at "
        f"{math.degrees(r.deflection):g}°, where the sin·cos "
        f"law of Eq. (8) falls {short:.2f} % short of linear."
    )
    return section(
        "Rate of one spring, N/mm: a wider separation makes the same joint from softer springs",
        table(head, rows, numbers=range(6)),
        caption=caption,
    )


def margins_table(d: SpringDesign) -> str:
    rows = margins(d)
    head = ["Quantity", "5 %", "median", "95 %", "limit", "meets it"]
    body = [_margin_row(m) for m in rows]
    spreads = ", ".join(f"{name.replace('_', ' ')} {100 * s:g} %" for name, s in spreads_of(d.unit).items())
    finding = (
        f"With parts that scatter, {100 * rows[-1].share:.0f} % of the actuators with {d.stiffness:.0f} "
        "N·m/rad "
        "meet all demands"
    )
    return section(
        finding,
        table(head, body, numbers=range(1, 6)),
        caption=f"One sigma, relative: {spreads}. 20 000 draws.",
    )


def _margin_row(m: Margin) -> list[str]:
    sign = words.unit(m.unit)
    if math.isnan(m.limit):
        return [m.name, "", "", "", "", f"{100 * m.share:.1f} %"]
    values = ["not possible" if math.isinf(v) else f"{words.number(v)} {sign}" for v in m.percentiles]
    return [m.name, *values, f"{words.number(m.limit)} {sign}", f"{100 * m.share:.1f} %"]
