"""Figs. 6 to 8 of the paper as drawn once, Figs. 9, 15, 18, 20 redrawn; drawings of docs/derivation.md."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from html import escape
from pathlib import Path

import numpy as np

from rsea_ros.identification.result import FrequencyResponse
from rsea_ros.model import outputs, transfer
from rsea_ros.model.equations import train_ratio
from rsea_ros.model.rig_file import load_rig
from rsea_ros.paper import formulas
from rsea_ros.paper.rival_models import MovingOutput, largest_gap, lumped_rig, readings, resonance_hz
from rsea_ros.records.record import FloatArray
from rsea_ros.report import words
from rsea_ros.report.figures import figure as fig
from rsea_ros.report.figures.figure import AFTER, BEFORE, GRID, INK, MEASURED, QUIET, TRUTH, Figure, faint
from rsea_ros.report.figures.response import Mark, ResponseCurve, response_figure, thin

_HZ: FloatArray = np.geomspace(0.1, 140.0, 500)


def circuit(name: str) -> str:
    """Return a drawing of the paper as SVG: torque is voltage, velocity is current.

    name: general (Fig. 6, an actuator between two loads), lumped (Fig. 7, both ends fixed: the branches of
    the loads are open, and one loop is left), epicyclic (Fig. 8, the train as a three-port: two transformers
    on the rotor's inertia). They were drawn once with schemdraw and are kept beside this file.
    """
    return (Path(__file__).parent / f"{name}_circuit.svg").read_text(encoding="utf-8").rstrip("\n")


_SHADES = [[0.0, "#eef3f8"], [0.5, "#7fa8cf"], [1.0, "#123f6d"]]


@dataclass(frozen=True)
class Point:
    """An actuator. stiffness: K_s, N m/rad. inertia: between its ends, kg m^2, of either sign; a negative one
    stands at its magnitude. side: where its name stands."""

    name: str
    stiffness: float
    inertia: float
    colour: str
    side: str = "top center"


def bandwidth_contours(title: str, shown: Sequence[Point], caption: str = "") -> fig.Figure:
    """Return lines of equal bandwidth by Eq. (7) with actuators among them."""
    k, j = _grid(shown)
    contours: fig.Json = {
        "type": "contour",
        "x": fig.numbers(k),
        "y": fig.numbers(1e3 * j),
        "z": [fig.numbers(row) for row in transfer.undamped_band(k[None, :], j[:, None])],
        "colorscale": _SHADES,
        "showscale": False,
        "contours": {"start": 20, "end": 400, "size": 20, "showlabels": True},
        "line": {"color": fig.faint(fig.INK, 0.35)},
        "hovertemplate": "K_s %{x:.0f} N·m/rad<br>inertia %{y:.2f} g·m²<br>%{z:.1f} Hz<extra></extra>",
    }
    plane = fig.layout(
        xaxis=fig.log_axis("stiffness, N·m/rad", k[0], k[-1]),
        yaxis=fig.log_axis("inertia, g·m²", 1e3 * j[0], 1e3 * j[-1]),
        hovermode="closest",
    )
    return fig.Figure(title, caption, [contours, *(_named(p) for p in shown)], plane, 480)


def _named(p: Point) -> fig.Json:
    z = float(transfer.undamped_band(p.stiffness, p.inertia))
    return {
        "type": "scatter",
        "mode": "markers+text",
        "x": [p.stiffness],
        "y": [1e3 * abs(p.inertia)],
        "text": [f"<b>{p.name.replace(', n', ',<br>n')}</b>"],
        "textposition": p.side,
        "textfont": {"size": 12, "color": fig.INK},
        "marker": {"size": 9, "color": p.colour, "line": {"color": "#ffffff", "width": 1}},
        "hovertemplate": f"{p.name}: {z:.1f} Hz<extra></extra>",
    }


def slices(title: str, shown: Sequence[Point], caption: str = "") -> fig.Figure:
    """Return Fig. 9 (b) and (c): bandwidth over inertia at some stiffnesses, and the other way round."""
    k, j = _grid(shown)
    shades = ("#9db9d6", "#5f8fbf", "#1864ab")
    views = [(f"{v:.0f} N·m/rad", 1e3 * j, transfer.undamped_band(v, j), "") for v in (200.0, 600.0, 1800.0)]
    views += [(f"{1e3 * v:g} g·m²", k, transfer.undamped_band(k, v), "2") for v in (1e-2, 3e-3, 1e-3)]
    data, names = [], []
    for (name, x, y, which), shade in zip(views, shades * 2, strict=True):
        place: fig.Json = {"xaxis": f"x{which}", "yaxis": f"y{which}"} if which else {}
        data.append(fig.line(x, y, name, shade, hovertemplate="%{y:.1f} Hz", **place))
        at: fig.Json = {"xref": f"x{which}", "yref": f"y{which}", "xshift": 6}
        names.append(fig.label(name, float(np.log10(x[-1])), float(np.log10(y[-1])), shade, **at))
    for p in shown:
        z = [float(transfer.undamped_band(p.stiffness, p.inertia))]
        data.append(fig.points([1e3 * abs(p.inertia)], z, p.name, p.colour, 9))
        data.append(fig.points([p.stiffness], z, p.name, p.colour, 9, xaxis="x2", yaxis="y2"))
    ticks = fig.marks(0.5, 2000.0)
    decades = {"type": "log", "tickvals": ticks, "ticktext": [f"{v:g}" for v in ticks]}
    drawing = fig.layout(
        xaxis=fig.axis("inertia, g·m²", domain=[0.0, 0.4], anchor="y", **decades),
        yaxis=fig.axis("bandwidth, Hz", anchor="x", **decades),
        xaxis2=fig.axis("stiffness, N·m/rad", domain=[0.56, 0.97], anchor="y2", **decades),
        yaxis2=fig.axis("", anchor="x2", **decades),
        annotations=names,
        hovermode="closest",
    )
    return fig.Figure(title, caption, data, drawing, 400)


def _grid(shown: Sequence[Point]) -> tuple[FloatArray, FloatArray]:
    """Return stiffnesses and inertias that hold the points with room around."""
    k, j = (np.abs([getattr(p, n) for p in shown]) for n in ("stiffness", "inertia"))
    stiffness: FloatArray = np.geomspace(min(100.0, k.min() / 2), max(4000.0, 1.5 * k.max()), 40)
    inertia: FloatArray = np.geomspace(min(3e-4, j.min() / 2), max(2e-2, 1.5 * j.max()), 40)
    return stiffness, inertia


def figure_9() -> list[Figure]:
    """Return the contours of Eq. (7) and its surface's two views, with the paper's two actuators."""
    points = []
    for name, rig_name, colour in (
        ("platform", "paper_high_impedance", AFTER),
        ("prototype", "prototype_knee", TRUTH),
    ):
        rig = load_rig(rig_name)
        k_s, planetary = rig["spring.stiffness"], rig.train == "planetary"
        points.append(Point(name, k_s, rig["chassis.inertia"], colour, side="middle right"))
        for train in (rig.train,) if planetary else formulas.PROTOTYPE_TRAINS:
            turned = replace(rig, train=train)
            sign = "" if planetary else f", n = {words.signed_text(train_ratio(turned), 0)}"
            inner = transfer.inner_inertia(turned)
            points.append(Point(f"{name}, with spin{sign}", k_s, inner, BEFORE, "middle left"))
    whole = bandwidth_contours(
        "Fig. 9 (a): bandwidth over stiffness and inertia, Eq. (7)", points,
        "Points: what the paper has (blue, green), and with the rotor's spin (orange). A "
        "negative n J_r + J_sc stands at its magnitude: T_d/T_p falls to −3 dB there.")  # fmt: skip
    views = slices(
        "Fig. 9 (b), (c): ten times the stiffness or a tenth of the inertia are worth √10 = 3.2 in bandwidth",
        points,
        "The paper prints no number on this figure. On logarithmic axes the surface is a plane.")  # fmt: skip
    return [whole, views]


def figure_15(measured: FrequencyResponse) -> Figure:
    """Return the high-impedance test: the printed fit, Table 2, and the test of a simulated bench."""
    c_0, c_1, c_2 = formulas.EQ_10
    s = 2j * np.pi * _HZ
    element = formulas.eq_1_lumped_distal_per_motor(1530.456, 0.957, 26.088)(s)
    table_2 = transfer.end_response(load_rig("paper_high_impedance"), _HZ)
    curves = [
        _measured_curve(measured, "simulated test"),
        ResponseCurve("Eq. (10) as printed", BEFORE, _HZ, np.asarray(c_0 / (s**2 + c_1 * s + c_2))),
        ResponseCurve("Eq. (4), Table 2", INK, _HZ, element, 1.4, "dash"),
        ResponseCurve("the same, sensor<br>sees K_s + b_s s", AFTER, _HZ, table_2),
    ]
    apart, edge = 20 * np.log10(c_0 / c_2), np.sqrt(c_2) / (2 * np.pi)
    title = f"Fig. 15: printed fit and Table 2 part by {-apart:.2f} dB at rest; lumped and unlumped are one"
    marks, caption = [Mark(edge, f"{edge:.2f} Hz")], "T_d/T_m with both ends clamped."
    return response_figure(words.minus(title), curves, marks, caption, decibel=(-60, 12))


def figure_18(test: MovingOutput) -> Figure:
    """Return the moving-output test: the bench's data, both fitted models."""
    curves = [_measured_curve(test.responses["spring_end"], "data of the<br>simulated bench")]
    shares = [100 * rival.held_out[0].explained for rival in test.rivals]
    for rival, share, colour in zip(test.rivals, shares, (AFTER, BEFORE), strict=True):
        name = f"<b>{rival.name}</b>, fitted:<br>{share:.2f} % explained"
        curves.append(ResponseCurve(name, colour, _HZ, transfer.end_response(rival.rig, _HZ)))
    title = (
        f"Fig. 18: the unlumped model explains {shares[0]:.2f} % of the held-out torque, the lumped "
        f"{shares[1]:.0f} %"
    )
    marks = [Mark(19.0, "19 Hz: “out of sync”", "right"), Mark(33.0, "33 Hz: “resonance”", "left")]
    caption = (
        "T_ft/T_m, housing with the pendulum free, spring end clamped. White noise of 30 N·m; the first half "
        "fitted, the second held out. At 19 Hz the unlumped model has its own resonance; the paper's "
        "resonance at 33 Hz is in neither."
    )
    return response_figure(title, curves, marks, caption, decibel=(-62, 12))


def figure_18_as_printed() -> Figure:
    """Return both models with Table 2's values, unfitted, as in the paper's simulation."""
    models = readings(load_rig("paper_moving_output"))
    looks = ((AFTER, "solid"), (BEFORE, "solid"), (BEFORE, "dot"))
    curves = [
        ResponseCurve(name.replace(", ", ",<br>"), colour, _HZ, transfer.end_response(model, _HZ), dash=dash)
        for (name, model), (colour, dash) in zip(models.items(), looks, strict=True)
    ]
    unlumped, moving, grounded = models.values()
    resonance, other = resonance_hz(unlumped), resonance_hz(moving)
    hz, gap = largest_gap(unlumped, grounded)
    title = (
        f"Fig. 18 with Table 2 as printed: resonance at {resonance:.1f} Hz unlumped, at {other:.1f} Hz lumped"
    )
    caption = (
        "“Lumped” has two readings: its loads moving (Fig. 16), or the motor pushing against the ground "
        f"(Fig. 3), which puts it {gap:.1f} dB above the unlumped model at {hz:.2f} Hz, the pendulum's "
        "frequency. There the pendulum swings by itself and holds no torque: none reaches the spring. In "
        "both readings the resonance is elsewhere."
    )
    marks = [Mark(other, f"{other:.1f} Hz", "right"), Mark(resonance, f"{resonance:.1f} Hz", "left")]
    return response_figure(title, curves, marks, caption, decibel=(-72, 16))


def end_to_end_curves(
    hz: FloatArray, name: str, spin: str, looks: Sequence[tuple[str, str]], sides: Sequence[str], first: Mark
) -> tuple[list[ResponseCurve], list[Mark]]:
    """Return the prototype by Eq. (6) and with the rotor's spin in either sense, and where each ends."""
    rig = load_rig("prototype_knee")
    k_s, s = rig["spring.stiffness"], 2j * np.pi * hz
    eq_6 = formulas.eq_6_distal_per_proximal(k_s, rig["chassis.inertia"], rig["spring.damping"])
    curves, marks = [ResponseCurve(name, AFTER, hz, eq_6(s))], [first]
    for train, (colour, dash), anchor in zip(formulas.PROTOTYPE_TRAINS, looks, sides, strict=True):
        turned = replace(rig, train=train)
        label = f"{spin}n = {words.signed_text(train_ratio(turned), 0)}"
        curves.append(ResponseCurve(label, colour, hz, transfer.end_to_end(turned)(s), dash=dash))
        edge = float(transfer.undamped_band(k_s, transfer.inner_inertia(turned)))
        marks.append(Mark(edge, f"{edge:.1f} Hz", anchor))
    return curves, marks


def prototype_band() -> float:
    """Return the bandwidth of the prototype by Eq. (7), Hz."""
    rig = load_rig("prototype_knee")
    return float(transfer.pure_torque_bandwidth(rig["spring.stiffness"], rig["chassis.inertia"]))


def figure_20() -> Figure:
    """Return the prototype end to end: Eq. (6), and with the rotor's spin."""
    hz: FloatArray = np.geomspace(1.0, 300.0, 1500)
    curves, marks = end_to_end_curves(
        hz, "Eq. (6), b_s = 0.02", "with the rotor's spin,<br>", ((BEFORE, "solid"), (BEFORE, "dash")),
        ("left", "right"), Mark(55.5, "55.5 Hz, printed"),
    )  # fmt: skip
    ours, edges = prototype_band(), " or ".join(f"{mark.hz:.1f}" for mark in marks[1:])
    title = (
        f"Fig. 20: {ours:.1f} Hz by Eq. (7), 55.5 Hz printed ({100 * (ours / 55.5 - 1):+.1f} %); {edges} Hz "
        "with the rotor's spin, by its sense"
    )
    caption = (
        "|T_d/T_p| of the prototype. A harmonic drive with its circular spline held turns backward (n = "
        "−160): no resonance. With the flexspline held n = +161. J_m is our estimate; the paper states "
        "neither it, nor the damping, nor what is held."
    )
    return response_figure(title, curves, marks, caption, decibel=(-20, 20))


def _measured_curve(response: FrequencyResponse, name: str) -> ResponseCurve:
    shown, _ = thin(response, None)
    keep = (shown.frequency >= _HZ[0]) & (shown.coherence > 0.02)
    return ResponseCurve(name, faint(MEASURED, 0.6), shown.frequency[keep], shown.response[keep], 5.0)


_WIDTH, _HEIGHT = 760.0, 300.0
_LEFT, _RIGHT, _TOP, _BOTTOM = 56.0, 190.0, 30.0, 44.0


def documentation_figures() -> dict[str, str]:
    """Return SVG by file name."""
    rig = load_rig("paper_high_impedance")
    apart = lumped_rig(rig)
    clamped = {
        "T_d/T_m, both models": (AFTER, rig, outputs.distal(rig, "element")),
        "T_p/T_m, lumped": (BEFORE, apart, outputs.proximal(apart)),
        "T_p/T_m, unlumped": (TRUTH, rig, outputs.proximal(rig)),
    }
    hz: FloatArray = np.geomspace(0.1, 140.0, 240)
    parts = [
        ResponseCurve(n, c, hz, transfer.frequency_response(of, y, hz)) for n, (c, of, y) in clamped.items()
    ]
    models = readings(load_rig("paper_moving_output")).items()
    moving = [
        ResponseCurve(name, colour, hz, transfer.end_response(model, hz))
        for (name, model), colour in zip(models, (AFTER, TRUTH, BEFORE), strict=True)
    ]
    hz = np.geomspace(1.0, 300.0, 400)
    band, looks = prototype_band(), ((BEFORE, "solid"), (TRUTH, "solid"))
    ends, edges = end_to_end_curves(
        hz, "Eq. (6)", "spin, ", looks, ("start", "end"), Mark(band, f"{band:.1f} Hz")
    )
    resonances = [Mark(1.34, "1.34 Hz"), Mark(6.07, "6.1 Hz"), Mark(19.8, "19.8 Hz")]
    return {
        "general_circuit.svg": _on_white(circuit("general")),
        "epicyclic_circuit.svg": _on_white(circuit("epicyclic")),
        "clamped.svg": gain_svg(parts, (-60.0, 20.0), [Mark(6.37, "6.4 Hz")]),
        "moving_output.svg": gain_svg(moving, (-70.0, 10.0), resonances),
        "end_to_end.svg": gain_svg(ends, (-40.0, 40.0), edges),
    }


def _on_white(svg: str) -> str:
    """Return a drawing that can be read on a dark page too."""
    return svg.replace('style="', 'style="background:#ffffff;', 1) + "\n"


def gain_svg(
    responses: Sequence[ResponseCurve], decibel: tuple[float, float], marks: Sequence[Mark] = ()
) -> str:
    """Return gain in dB over frequency, each curve named in its colour on the right."""
    low, high = responses[0].hz[0], responses[0].hz[-1]

    def x(hz: float) -> float:
        return _LEFT + (_WIDTH - _LEFT - _RIGHT) * math.log(hz / low) / math.log(high / low)

    def y(db: float) -> float:
        return _TOP + (_HEIGHT - _TOP - _BOTTOM) * (decibel[1] - db) / (decibel[1] - decibel[0])

    parts = [f'<rect width="{_WIDTH:g}" height="{_HEIGHT:g}" fill="#ffffff"/>']
    for db in np.arange(math.ceil(decibel[0] / 20) * 20, decibel[1] + 1, 20):
        parts.append(_stroke(_LEFT, y(db), x(high), y(db), GRID))
        parts.append(_text(words.minus(f"{db:.0f}"), _LEFT - 8, y(db) + 4, QUIET, "end"))
    for hz in fig.marks(low, high):
        parts.append(_stroke(x(hz), y(decibel[0]), x(hz), y(decibel[1]), GRID))
        parts.append(_text(f"{hz:g}", x(hz), y(decibel[0]) + 18, QUIET, "middle"))
    for mark in marks:
        parts.append(
            _stroke(x(mark.hz), y(decibel[0]), x(mark.hz), y(decibel[1]), QUIET, 'stroke-dasharray="2 3"')
        )
        anchor = {"start": "start", "end": "end"}.get(mark.anchor, "middle")
        parts.append(_text(mark.text, x(mark.hz), _TOP - 8, QUIET, anchor))
    for i, r in enumerate(responses):
        db = np.clip(20.0 * np.log10(np.abs(r.values)), decibel[0], decibel[1])
        points = " ".join(f"{x(f):.1f},{y(v):.1f}" for f, v in zip(r.hz, db, strict=True))
        parts.append(
            f'<polyline points="{points}" fill="none" stroke="{r.colour}" stroke-width="{r.width:g}"/>'
        )
        parts.append(_text(r.name, x(high) + 12, _TOP + 12 + 20 * i, r.colour))
    parts.append(_text("frequency, Hz", 0.5 * (_LEFT + x(high)), _HEIGHT - 8, QUIET, "middle"))
    parts.append(_text("gain, dB", 8, _TOP - 10, QUIET))
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH:g} {_HEIGHT:g}" width="{_WIDTH:g}" '
        f'font-family="system-ui, sans-serif" font-size="13" fill="{INK}">{"".join(parts)}</svg>\n'
    )


def _stroke(x_1: float, y_1: float, x_2: float, y_2: float, colour: str, more: str = "") -> str:
    return f'<line x1="{x_1:.1f}" y1="{y_1:.1f}" x2="{x_2:.1f}" y2="{y_2:.1f}" stroke="{colour}" {more}/>'


def _text(text: str, x: float, y: float, colour: str, anchor: str = "start") -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" fill="{colour}" text-anchor="{anchor}">{escape(text)}</text>'
