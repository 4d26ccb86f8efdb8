"""Figs. 6 to 8 of the paper as drawn once, and Figs. 9, 15, 18 and 20 redrawn."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from rsea_ros.identification.result import FrequencyResponse
from rsea_ros.model import outputs
from rsea_ros.model.equations import train_ratio
from rsea_ros.model.rig import Rig
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.transfer import (
    end_to_end,
    frequency_response,
    inner_inertia,
    pure_torque_bandwidth,
    undamped_band,
)
from rsea_ros.paper import formulas
from rsea_ros.paper.claims import PROTOTYPE_TRAINS
from rsea_ros.paper.rival_models import MovingOutput, largest_gap, readings, resonance_hz
from rsea_ros.records.record import ComplexArray, FloatArray
from rsea_ros.report import words
from rsea_ros.report.design.surface import Point, bandwidth_contours, slices
from rsea_ros.report.figures.bode import thin
from rsea_ros.report.figures.figure import AFTER, BEFORE, INK, MEASURED, TRUTH, Figure, faint
from rsea_ros.report.figures.response_curves import Mark, ResponseCurve, response_figure

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
        for train in (rig.train,) if planetary else PROTOTYPE_TRAINS:
            turned = replace(rig, train=train)
            sign = "" if planetary else f", n = {words.signed_text(train_ratio(turned), 0)}"
            inner = inner_inertia(turned)
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


def end_response(rig: Rig, hz: FloatArray) -> ComplexArray:
    """Return the torque at the end of the spring over the motor's."""
    return frequency_response(rig, outputs.end_torque(rig, "spring_end"), hz)


def figure_15(measured: FrequencyResponse) -> Figure:
    """Return the high-impedance test: the printed fit, Table 2, and the test of a simulated bench."""
    c_0, c_1, c_2 = formulas.EQ_10
    s = 2j * np.pi * _HZ
    element = formulas.eq_1_lumped_distal_per_motor(1530.456, 0.957, 26.088)(s)
    table_2 = end_response(load_rig("paper_high_impedance"), _HZ)
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
        curves.append(ResponseCurve(name, colour, _HZ, end_response(rival.rig, _HZ)))
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
        ResponseCurve(name.replace(", ", ",<br>"), colour, _HZ, end_response(model, _HZ), dash=dash)
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
    for train, (colour, dash), anchor in zip(PROTOTYPE_TRAINS, looks, sides, strict=True):
        turned = replace(rig, train=train)
        label = f"{spin}n = {words.signed_text(train_ratio(turned), 0)}"
        curves.append(ResponseCurve(label, colour, hz, end_to_end(turned)(s), dash=dash))
        edge = float(undamped_band(k_s, inner_inertia(turned)))
        marks.append(Mark(edge, f"{edge:.1f} Hz", anchor))
    return curves, marks


def prototype_band() -> float:
    """Return the bandwidth of the prototype by Eq. (7), Hz."""
    rig = load_rig("prototype_knee")
    return float(pure_torque_bandwidth(rig["spring.stiffness"], rig["chassis.inertia"]))


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
