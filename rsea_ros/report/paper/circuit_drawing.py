"""Figs. 6, 7 and 8 of the paper as drawings: torque is voltage, velocity is current."""

from __future__ import annotations

import re
from functools import partial
from typing import Any

import schemdraw
from schemdraw import elements

from rsea_ros.report.figures.palette import AFTER, INK, QUIET

Point = tuple[float, float]
elm: Any = elements
"""schemdraw's elements are partly typed."""

_TOP = 3.4
_INDEX = re.compile(r"([A-Za-zω])_([A-Za-z0-9]+)")
_Coil = partial(elm.Inductor2, loops=3)


def general_circuit() -> str:
    """Return Fig. 6, a series elastic actuator between two loads, as SVG."""
    d = _drawing()
    _between(d, elm.RBox(), (0, 0), (0, _TOP), "Z_lp")
    _current(d, _between(d, _Coil(), (0, _TOP), (3.4, _TOP), "J_h"), "ω_h")
    _between(d, elm.SourceV(), (3.4, 0), (3.4, _TOP / 2), "T_m", "right")
    _between(d, elm.RBox(), (3.4, _TOP / 2), (3.4, _TOP), "Z_m", "right")
    _current(d, _between(d, _Coil(), (3.4, _TOP), (8.0, _TOP), "J_sc"), "ω_c")
    _between(d, elm.RBox(), (8.0, _TOP), (8.0, 0), "Z_s", "right")
    _current(d, _between(d, elm.Line(), (8.0, _TOP), (12.0, _TOP)), "ω_d")
    _between(d, elm.RBox(), (12.0, _TOP), (12.0, 0), "Z_ld", "right")
    _between(d, elm.Line(), (0, 0), (12.0, 0))
    _voltage(d, (0.8, 0.3), (0.8, _TOP - 0.8), "T_p")
    _voltage(d, (10.7, 0.3), (10.7, _TOP - 0.8), "T_d")
    _dots(d, (3.4, 0), (3.4, _TOP), (8.0, 0), (8.0, _TOP))
    return _svg(d, "Equivalent circuit of a series elastic actuator between two loads")


def lumped_circuit() -> str:
    """Return Fig. 7, both ends fixed: the branches of the loads are open, and one loop is left."""
    d = _drawing()
    _between(d, elm.SourceV(), (0, 0), (0, _TOP), "T_m", "left")
    _between(d, elm.Resistor(), (0, _TOP), (2.6, _TOP), "b_m")
    _current(d, _between(d, _Coil(), (2.6, _TOP), (6.0, _TOP), "J_eff = J_sc + J_m", colour=AFTER), "ω_c")
    _between(d, elm.Resistor(), (6.0, _TOP), (6.0, _TOP / 2), "b_s", "right")
    _between(d, elm.Capacitor(), (6.0, _TOP / 2), (6.0, 0), "1/K_s", "right")
    _between(d, elm.Line(), (0, 0), (8.6, 0))
    _between(d, elm.Line(), (6.0, _TOP), (8.6, _TOP))
    for y in (0.0, _TOP):
        d += elm.Dot(open=True).at((8.6, y)).color(INK)
    _voltage(d, (8.6, 0.4), (8.6, _TOP - 0.4), "T_d")
    d += elm.Label().at((9.6, _TOP / 2)).label("clamped: open", halign="left", color=QUIET)
    _dots(d, (6.0, 0), (6.0, _TOP))
    return _svg(d, "Lumped circuit of the high-impedance test")


def epicyclic_circuit() -> str:
    """Return Fig. 8, the epicyclic train as a three-port: two transformers on the rotor's inertia."""
    d, top = _drawing(), 4.6
    _between(d, elm.RBox(), (0, 0), (0, top), "Z_lp")
    _current(d, _between(d, _Coil(), (0, top), (3.0, top), "J_h"), "ω_h")
    _between(d, _Coil(), (3.0, top), (5.0, top), "Mu_2 : 1", colour=AFTER)
    _between(d, _Coil(), (5.0, 3.7), (3.0, 3.7))
    _between(d, elm.Line(), (5.0, top), (8.2, top))
    _rotor(d)
    _between(d, _Coil(), (8.2, top), (8.2, 2.6), "Mu_1 : 1", "right", AFTER)
    _between(d, elm.Resistor(), (8.2, 2.6), (8.2, 1.3), "b_m", "right")
    _between(d, elm.SourceV(), (8.2, 0), (8.2, 1.3), "T_m", "right")
    _current(d, _between(d, _Coil(), (8.2, top), (11.4, top), "J_sc"), "ω_c")
    _between(d, elm.Resistor(), (11.4, top), (11.4, top / 2), "b_s", "right")
    _between(d, elm.Capacitor(), (11.4, top / 2), (11.4, 0), "1/K_s", "right")
    _current(d, _between(d, elm.Line(), (11.4, top), (14.6, top)), "ω_d")
    _between(d, elm.RBox(), (14.6, top), (14.6, 0), "Z_ld", "right")
    _between(d, elm.Line(), (0, 0), (14.6, 0))
    _voltage(d, (0.8, 0.3), (0.8, top - 0.8), "T_p")
    _voltage(d, (13.3, 0.3), (13.3, top - 0.8), "T_d")
    _dots(d, (5.9, 0), (8.2, 0), (8.2, top), (11.4, 0), (11.4, top))
    _polarity(d, (3.42, 4.3), (4.6, 3.42), (7.82, 3.05), (7.05, 3.35))
    return _svg(d, "Equivalent circuit with the epicyclic train as a three-port")


def _rotor(d: schemdraw.Drawing) -> None:
    """Draw the common secondary of the two transformers and the rotor's inertia on it."""
    _between(d, elm.Line(), (5.0, 3.7), (7.4, 3.7))
    _between(d, _Coil(), (7.4, 1.9), (7.4, 3.7))
    _between(d, elm.Line(), (7.4, 3.7), (7.4, 3.7))
    _between(d, _Coil(), (5.9, 3.7), (5.9, 1.9), "J_r", "left", AFTER)
    for a, b in (((3.0, 3.7), (3.0, 1.9)), ((3.0, 1.9), (7.4, 1.9)), ((5.9, 1.9), (5.9, 0.0))):
        _between(d, elm.Line(), a, b)
    _dots(d, (5.9, 3.7), (5.9, 1.9))


def _between(
    d: schemdraw.Drawing,
    element: Any,
    start: Point,
    stop: Point,
    text: str = "",
    side: str = "",
    colour: str = INK,
) -> Any:
    """Draw an element from one point to another with its name beside it."""
    element.at(start).to(stop).color(INK)
    d += element
    if text:
        middle = (0.5 * (start[0] + stop[0]), 0.5 * (start[1] + stop[1]))
        gap, align = {"left": (-0.75, "right"), "right": (0.75, "left")}.get(side, (0.0, "center"))
        up = 0.0 if side else 0.62
        if not side and start[0] == stop[0]:
            gap, up, align = -0.5, 0.0, "right"
        at = (middle[0] + gap, middle[1] + up)
        d += elm.Label().at(at).label(text, halign=align, valign="center", color=colour)
    return element


def _current(d: schemdraw.Drawing, element: Any, text: str) -> None:
    """Draw an arrow and the name of the velocity below an element."""
    x = 0.5 * (element.start[0] + element.end[0])
    y = element.start[1] - 0.42
    d += elm.Arrow(headwidth=0.16, headlength=0.22).at((x - 0.5, y)).to((x + 0.2, y)).color(QUIET)
    d += elm.Label().at((x + 0.35, y)).label(text, halign="left", valign="center", color=QUIET)


def _voltage(d: schemdraw.Drawing, low: Point, high: Point, text: str) -> None:
    """Draw an arrow for a torque."""
    d += elm.Arrow(headwidth=0.16, headlength=0.22).at(low).to(high).color(QUIET).linewidth(0.9)
    middle = (low[0] + 0.2, 0.5 * (low[1] + high[1]))
    d += elm.Label().at(middle).label(text, halign="left", valign="center", color=QUIET)


def _dots(d: schemdraw.Drawing, *points: Point) -> None:
    for point in points:
        d += elm.Dot(radius=0.07).at(point).color(INK)


def _polarity(d: schemdraw.Drawing, *points: Point) -> None:
    """Mark one end of each winding: a velocity that enters a winding at its mark leaves the other at its."""
    for point in points:
        d += elm.Dot(radius=0.08).at(point).color(AFTER)


def _drawing() -> schemdraw.Drawing:
    schemdraw.use("svg")
    d = schemdraw.Drawing(show=False)
    d.config(fontsize=14, lw=1.4, color=INK, font="system-ui, sans-serif", margin=0.25)
    return d


def _svg(d: schemdraw.Drawing, spoken: str) -> str:
    """Return the drawing as SVG, with text after _ as an index."""
    text = d.get_imagedata("svg").decode("utf-8")
    text = _INDEX.sub(r'\1<tspan dy="4" font-size="10">\2</tspan><tspan dy="-4">​</tspan>', text)
    look = f'style="max-width:100%;height:auto" role="img" aria-label="{spoken}"'
    return text.replace("<svg ", f"<svg {look} ", 1)
