"""The report of a controlled actuator: torque tracking and output impedance."""

from __future__ import annotations

import math

import numpy as np

from rsea_ros.control.study import AtRate, Study
from rsea_ros.model import outputs
from rsea_ros.model.response import frequency_response
from rsea_ros.report.control.tables import control_tables, gains_words
from rsea_ros.report.figures.figure import Figure, axis, frequency_axis, label, layout, line
from rsea_ros.report.figures.palette import AFTER, BEFORE, MEASURED, QUIET, TRUTH
from rsea_ros.report.figures.response import Mark, Response, response_figure
from rsea_ros.report.page.frame import Block, page
from rsea_ros.report.page.html import bullets, key_numbers, section

_COLOURS = (AFTER, BEFORE, TRUTH)


def control_report(study: Study) -> str:
    """Return the page."""
    blocks: list[Block] = [
        key_numbers(_keys(study)),
        section("Gains", bullets(list(gains_words(study)))),
        _following(study),
        _feeling(study),
        *control_tables(study),
    ]
    return page(verdict(study), f"Torque control · {study.rig.name}", blocks, _footer(study))


def verdict(study: Study) -> str:
    """Return the verdict in a sentence."""
    missed = [f"{t.what} at {at.design.rate:g} Hz" for at in study.rates for t in at.trials if t.met is False]
    slowest = study.rates[0]
    reached = f"Stable on all {slowest.swept.cases} benches of the set, from locked to free"
    if any(at.swept.unstable for at in study.rates):
        reached = "Unstable on part of the set"
    return f"{reached}; missed: {'; '.join(missed)}" if missed else f"{reached}, with every margin kept"


def _crossover(at: AtRate) -> float:
    return at.design.margins["locked"].crossover


def _keys(study: Study) -> list[tuple[str, str]]:
    at = study.rates[0]
    value = {trial.what: trial for trial in at.trials}
    errors = [(f"{t.value:.1f} %", what) for what, t in value.items() if t.unit == "%"][:1]
    return [
        (f"{study.resonance:.1f} Hz", "resonance of the open loop"),
        (f"{_crossover(at):.1f} Hz", f"crossover at {at.design.rate:g} Hz, one sample of delay"),
        (f"{at.design.margins['locked'].phase:.0f}°", "phase margin, locked"),
        (f"{at.swept.margins.phase:.0f}°", "smallest of the whole set"),
        *errors,
    ]


def _following(study: Study) -> Figure:
    """Return T_d over desired torque, locked and free apart, the worst case of the set, and the open loop."""
    curves = []
    for at, colour in zip(study.rates, _COLOURS, strict=False):
        rate = f"{at.design.rate:g} Hz"
        for name, seen, width, dash in (
            ("locked", at.locked, 2.4, "solid"),
            ("free", at.free, 1.6, "dot"),
            ("worst case", at.hard, 1.0, "dash"),
        ):
            curves.append(Response(f"{rate}, {name}", colour, seen.hz, seen.torque, width, dash))
    hz = np.geomspace(0.5, 0.45 * max(at.design.rate for at in study.rates), 300)
    for rig, dash in ((study.rig, "solid"), (study.free, "dot")):
        opened = frequency_response(rig, outputs.end_torque(rig, "spring_end"), hz)
        name = "open loop, locked" if rig is study.rig else "open loop, free"
        curves.append(Response(name, MEASURED, hz, opened, 1.2, dash))
    caption = (
        "Distal over desired torque, sine by sine, in simulation; the controller does not know the load. "
        "Slow torques are predicted along a parabola; fast ones go through a low pass and come two "
        "samples late. Hardest of the set: stiffer spring, less drag, one sample more, 2 ms of lag, a "
        "mode of 33 Hz at the sensor."
    )
    title = "The torque tracks equally well with the actuator clamped and free"
    return response_figure(
        title, curves, [Mark(3.0 * study.resonance, "3 × resonance")], caption, (-60.0, 20.0)
    )


def _feeling(study: Study) -> Figure:
    """Return the output impedance."""
    first = study.rates[0].impedance
    items = [(f"{at.design.rate:g} Hz", at.impedance.hz, at.impedance.controlled, c, "solid")
             for at, c in zip(study.rates, _COLOURS, strict=False)]  # fmt: skip
    items += [("motor off", first.hz, first.motor_off, QUIET, "dash"),
              ("passive spring", first.hz, first.spring, MEASURED, "dot")]  # fmt: skip
    data = [
        line(hz, np.abs(z), name, colour, line={"color": colour, "width": 1.8, "dash": dash})
        for name, hz, z, colour, dash in items
    ]
    names = [
        label(name, 1.015, 1.0 - 0.08 * i, colour, xref="paper", yref="paper", yanchor="top")
        for i, (name, _, _, colour, _) in enumerate(items)
    ]
    one = int(np.argmin(np.abs(first.hz - 1.0)))
    softer = abs(first.spring[one]) / abs(first.controlled[one])
    highest = max(float(at.impedance.hz[-1]) for at in study.rates)
    return Figure(
        title=f"At 1 Hz the moved output is {softer:.0f} times softer than the spring alone",
        caption="Torque error for each rad/s of the distal side, housing clamped. Spring alone: K_s/s + b_s.",
        data=data,
        layout=layout(
            xaxis=frequency_axis(float(first.hz[0]), highest),
            yaxis=axis("N·m per rad/s", type="log"),
            annotations=names,
            margin={"l": 64, "r": 150, "t": 12, "b": 48},
        ),
        height=400,
    )


def _footer(study: Study) -> list[str]:
    motors = [f"{m.name}: {m.torque:g} N·m, {_speed(m.speed)} ({m.source})" for m in study.reaches]
    return [*motors, "rsea control. All in SI. One sample of delay and the hold are in every number."]


def _speed(speed: float) -> str:
    return f"{speed:.3g} rad/s" if math.isfinite(speed) else "speed not stated"
