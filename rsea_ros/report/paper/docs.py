"""The figures of docs/derivation.md: `rsea paper --figures docs/figures` makes them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rsea_ros.model import outputs
from rsea_ros.model.bandwidth import end_to_end, inner_inertia, pure_torque_bandwidth, undamped_band
from rsea_ros.model.equations import train_ratio
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.transfer import frequency_response
from rsea_ros.paper import formulas
from rsea_ros.paper.claims import PROTOTYPE_TRAINS
from rsea_ros.paper.figure_18 import readings
from rsea_ros.paper.rival_models import lumped_rig
from rsea_ros.records.record import FloatArray
from rsea_ros.report import words
from rsea_ros.report.figures.palette import AFTER, BEFORE, TRUTH
from rsea_ros.report.figures.response_curves import Mark, ResponseCurve
from rsea_ros.report.paper.circuit_drawing import epicyclic_circuit, general_circuit
from rsea_ros.report.paper.svg import gain_svg

_HZ: FloatArray = np.geomspace(0.1, 140.0, 240)


def documentation_figures() -> dict[str, str]:
    """Return SVG by file name."""
    return {
        "general_circuit.svg": _on_white(general_circuit()),
        "epicyclic_circuit.svg": _on_white(epicyclic_circuit()),
        "clamped.svg": _clamped_part(),
        "moving_output.svg": _moving_output(),
        "end_to_end.svg": _end_to_end(),
    }


def _on_white(svg: str) -> str:
    """Return a drawing that can be read on a dark page too."""
    return svg.replace('style="', 'style="background:#ffffff;', 1) + "\n"


def _clamped_part() -> str:
    rig = load_rig("paper_high_impedance")
    apart = lumped_rig(rig)
    read = {
        "T_d/T_m, both models": (AFTER, rig, outputs.distal(rig, "element")),
        "T_p/T_m, lumped": (BEFORE, apart, outputs.proximal(apart)),
        "T_p/T_m, unlumped": (TRUTH, rig, outputs.proximal(rig)),
    }
    curves = [
        ResponseCurve(n, c, _HZ, frequency_response(model, y, _HZ)) for n, (c, model, y) in read.items()
    ]
    return gain_svg(curves, (-60.0, 20.0), [Mark(6.37, "6.4 Hz")])


def _moving_output() -> str:
    rig = load_rig("paper_moving_output")
    curves = [
        ResponseCurve(
            name, colour, _HZ, frequency_response(model, outputs.end_torque(model, "spring_end"), _HZ)
        )
        for (name, model), colour in zip(readings(rig).items(), (AFTER, TRUTH, BEFORE), strict=True)
    ]
    return gain_svg(
        curves, (-70.0, 10.0), [Mark(1.34, "1.34 Hz"), Mark(6.07, "6.1 Hz"), Mark(19.8, "19.8 Hz")]
    )


def _end_to_end() -> str:
    hz: FloatArray = np.geomspace(1.0, 300.0, 400)
    rig = load_rig("prototype_knee")
    k_s, j_sc = rig["spring.stiffness"], rig["chassis.inertia"]
    eq_6 = formulas.eq_6_distal_per_proximal(k_s, j_sc, rig["spring.damping"])
    curves = [ResponseCurve("Eq. (6)", AFTER, hz, eq_6(2j * np.pi * hz))]
    edge = pure_torque_bandwidth(k_s, j_sc)
    marks = [Mark(edge, f"{edge:.1f} Hz")]
    for train, colour, anchor in zip(PROTOTYPE_TRAINS, (BEFORE, TRUTH), ("start", "end"), strict=True):
        turned = replace(rig, train=train)
        name = f"spin, n = {words.signed_text(train_ratio(turned), 0)}"
        curves.append(ResponseCurve(name, colour, hz, end_to_end(turned)(2j * np.pi * hz)))
        edge = float(undamped_band(k_s, inner_inertia(turned)))
        marks.append(Mark(edge, f"{edge:.1f} Hz", anchor))
    return gain_svg(curves, (-40.0, 40.0), marks)
