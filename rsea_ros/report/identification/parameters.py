"""The table of parameters: value, interval, initial value, and how well the data determine it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from html import escape

from rsea_ros.identification.result import CLOCKS, ParameterEstimate
from rsea_ros.records.statistics import Z95
from rsea_ros.report import words
from rsea_ros.report.figures.palette import AFTER, GRID, QUIET, faint
from rsea_ros.report.page.html_table import table_of_rows

_WIDTH, _HEIGHT = 190.0, 26.0


def parameter_table(parameters: Sequence[ParameterEstimate]) -> str:
    """Return the HTML table of the physical parameters, sensor clocks left out."""
    physical = [p for p in parameters if not p.name.startswith(CLOCKS)]
    head = ("Parameter", "#Value ± 95 %", "Unit", "Compared with the rig", "#Rig", "#Change",
            "Determined by data")  # fmt: skip
    return table_of_rows(head, (_row(p) for p in physical))


def clock_sentence(parameters: Sequence[ParameterEstimate]) -> str:
    """Return the time offsets of the sensors; empty if all stamps may be correct."""
    clocks = [p for p in parameters if p.name.startswith(CLOCKS) and not p.ci95[0] <= 0.0 <= p.ci95[1]]
    if not clocks:
        return ""
    parts = [
        f"{words.channel(p.name.split('.')[1])} {words.quantity(p.value, p.unit, 2)} "
        f"(95 %: {words.quantity(p.ci95[0], p.unit, 2)} to {words.quantity(p.ci95[1], p.unit, 2)})"
        f"{' of the time passed' if p.unit == 'ppm' else ''}"
        for p in clocks
    ]
    return f"Sensors read later than their stamps by: {'; '.join(parts)}."


def value_text(p: ParameterEstimate) -> tuple[str, str]:
    """Return a value and its 95 % interval: ("1530.5", " ± 0.1"), or lopsided ("1391", " (1391 … 1531)")."""
    value, half = words.with_interval(p.value, *p.ci95)
    if not half:
        return value, ""
    low, high = p.ci95
    sides = sorted((p.value - low, high - p.value))
    if sides[1] <= words.LOPSIDED * sides[0]:
        return value, f" ± {half}"
    step = 10.0 ** (math.floor(math.log10(sides[1])) - 2)
    ends = (step * math.floor(low / step), step * math.ceil(high / step))
    value, low_text, high_text = (_round_text(v, step) for v in (p.value, *ends))
    return value, f" ({low_text} … {high_text})"


def _round_text(value: float, step: float) -> str:
    """Return a value to a decimal step, plain where that is short."""
    decimals = -round(math.log10(step))
    shown = f"{value:.{max(0, decimals)}f}" if decimals < 9 else f"{value:.2e}"
    return words.minus(shown)


def _row(p: ParameterEstimate) -> str:
    value, doubt = value_text(p)
    change = words.minus(f"{100.0 * (p.value / p.start - 1.0):+.1f} %") if p.start else "–"
    return (
        f"<tr><td>{escape(words.parameter(p.name))} {_symbol(p.name)}<small>{escape(p.name)}</small></td>"
        f"<td class='number'><b>{value}</b>{doubt}</td><td class='unit'>{escape(words.unit(p.unit))}</td>"
        f"<td>{_interval(p)}</td><td class='number'>{words.number(p.start, 4)}</td>"
        f"<td class='number'>{change}</td><td>{p.determined}</td></tr>"
    )


def _symbol(name: str) -> str:
    letter, _, index = words.SYMBOLS.get(name, "").partition("_")
    return f"<i>{letter}</i><sub>{index}</sub>" if letter else ""


def _interval(p: ParameterEstimate) -> str:
    """Return a small drawing: prior as a grey bar (95 %), its middle, and the result with its interval."""
    side = Z95 * p.spread * abs(p.start)
    if not (math.isfinite(side) and side > 0.0):
        side = max(abs(p.value - p.start), p.ci95[1] - p.ci95[0]) or 1.0
    reach = 1.15 * max(side, abs(p.value - p.start), *(abs(v - p.start) for v in p.ci95 if math.isfinite(v)))

    def at(value: float) -> float:
        return _WIDTH / 2.0 * (1.0 + max(-1.0, min(1.0, (value - p.start) / reach)))

    middle = _HEIGHT / 2.0
    rig = f"rig {p.start - side:.4g} to {p.start + side:.4g}"
    spoken = escape(f"{rig}, result {p.value:.4g} {words.unit(p.unit)}".rstrip())
    return (
        f'<svg class="interval" viewBox="0 0 {_WIDTH:g} {_HEIGHT:g}" role="img" aria-label="{spoken}">'
        f"<title>{spoken}</title>"
        f"{_stroke(at(p.start - side), at(p.start + side), middle, GRID, 8)}"
        f'<line x1="{at(p.start):.1f}" x2="{at(p.start):.1f}" y1="{middle - 7:g}" y2="{middle + 7:g}" '
        f'stroke="{QUIET}"/>'
        f"{_stroke(at(p.ci95[0]), at(p.ci95[1]), middle, faint(AFTER, 0.55), 6)}"
        f'<circle cx="{at(p.value):.1f}" cy="{middle:g}" r="4" fill="{AFTER}"/></svg>'
    )


def _stroke(low: float, high: float, height: float, colour: str, width: float) -> str:
    """Return a horizontal stroke with round ends."""
    return (
        f'<line x1="{low:.1f}" x2="{high:.1f}" y1="{height:g}" y2="{height:g}" '
        f'stroke="{colour}" stroke-width="{width:g}" stroke-linecap="round"/>'
    )
