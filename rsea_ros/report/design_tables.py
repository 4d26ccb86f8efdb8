"""The tables of a design's page: demands, springs, margins."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from rsea_ros.design.judge import Check, Design, judge
from rsea_ros.design.margins import SPREADS, Margin, margins
from rsea_ros.report import words
from rsea_ros.report.page import section
from rsea_ros.report.table import table


def checks_table(designs: Sequence[Design]) -> str:
    head = ["Demand", "Limit", *(f"K_s = {d.stiffness:.0f} N·m/rad" for d in designs)]
    rows = []
    for i, check in enumerate(designs[0].checks):
        sign = "≥" if check.least else "≤"
        limit = f"{sign} {words.number(check.limit)} {_unit(check)}"
        rows.append([check.name, limit, *(_cell(d.checks[i]) for d in designs)])
    met = [d for d in designs if d.feasible]
    finding = (
        f"{len(met)} of {len(designs)} designs meet all demands"
        if met
        else "No design meets all demands: the motor is too weak"
    )
    return section(finding, table(head, rows, numbers=range(1, len(head))))


def _cell(check: Check) -> str:
    value = "not possible" if math.isnan(check.value) else f"{words.number(check.value)} {_unit(check)}"
    return f"{'✓' if check.met else '✗'} {value}"


def _unit(check: Check) -> str:
    return "°" if check.unit == "deg" else words.unit(check.unit)


def springs_table(designs: Sequence[Design]) -> str:
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
        rates = [judge(varied, d.unit, d.stiffness).rate for d in designs]
        travel = 0.5 * separation * math.sin(r.deflection)
        rows.append(
            [words.number(1e3 * separation), *(f"{v / 1e3:.0f}" for v in rates), words.number(1e3 * travel)]
        )
    short = 100.0 * designs[0].error
    caption = (
        f"Eq. (9) turned round, r_s = {1e3 * r.spring_radius:.1f} mm. Travel at "
        f"{math.degrees(r.deflection):g}°, where the sin·cos "
        f"law of Eq. (8) falls {short:.2f} % short of linear."
    )
    return section(
        "Rate of one spring, N/mm: a wider separation makes the same joint from softer springs",
        table(head, rows, numbers=range(6)),
        caption=caption,
    )


def margins_table(d: Design) -> str:
    rows = margins(d)
    head = ["Quantity", "5 %", "median", "95 %", "limit", "meets it"]
    body = [_margin_row(m) for m in rows]
    spreads = ", ".join(f"{name.replace('_', ' ')} {100 * s:g} %" for name, s in SPREADS.items())
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
    sign = "°" if m.unit == "deg" else words.unit(m.unit)
    if math.isnan(m.limit):
        return [m.name, "", "", "", "", f"{100 * m.share:.1f} %"]
    values = ["not possible" if math.isinf(v) else f"{words.number(v)} {sign}" for v in m.percentiles]
    return [m.name, *values, f"{words.number(m.limit)} {sign}", f"{100 * m.share:.1f} %"]
