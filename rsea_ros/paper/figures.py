"""Figs. 6 to 8 of the paper as drawn once, Figs. 9, 15, 18, 20 redrawn; drawings of docs/derivation.md."""

import math
from collections.abc import Sequence
from dataclasses import replace
from html import escape
from pathlib import Path

import numpy as np

from rsea_ros.identification.result import FrequencyResponse
from rsea_ros.model import outputs, transfer
from rsea_ros.model.equations import train_ratio
from rsea_ros.model.rig_file import load_rig
from rsea_ros.paper import formulas
from rsea_ros.paper.rival_models import MovingOutput, largest_gap, lumped_rig, readings, resonance_hz
from rsea_ros.paper.surface import Point, bandwidth_contours, slices
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
