"""A controlled actuator in tables: trials, gains and margins, compensations, limits; and control.json."""

import math
import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from rsea_ros.control.robustness import Reach
from rsea_ros.control.study import AtRate, Compensated, Study, TrialResult
from rsea_ros.report import words
from rsea_ros.report.page import Html, section, table
from rsea_ros.report.result_files import pick

Rows = list[list[str]]
REACH_HEAD = ["motor", "amplitude", "clamped: limit from", "free: limit from"]


def rates(study: Study) -> list[str]:
    """Return the rates of the control loop, `280 Hz`."""
    return [f"{at.design.rate:g} Hz" for at in study.rates]


def trial_rows(study: Study) -> Rows:
    """Return each trial with its demand and its value at every rate; a value that misses it is marked."""
    return [
        [typeset(trials[0].what), _demand(trials[0]), *map(trial_text, trials)]
        for trials in zip(*(at.trials for at in study.rates), strict=True)
    ]


def typeset(name: str) -> str:
    """Return the name of a trial or of a load with proper signs, `free x 0.5` as `free × 0.5`."""
    return re.sub(r"(?<!\w)-(?=\d)", "−", name.replace(" x ", " × "))


def _demand(trial: TrialResult) -> str:
    limits = [words.number(limit, 3) for limit in (trial.asked, trial.allowed) if limit is not None]
    if not limits:
        return ""
    worst = f" (worst {limits[-1]})" if trial.allowed is not None and len(limits) > 1 else ""
    return f"{'≥' if trial.least else '≤'} {limits[0]}{worst} {_unit(trial.unit)}".strip()


def trial_text(trial: TrialResult) -> str:
    """Return the value with its unit and that of the worst case, marked where it misses its demand."""
    missed = "missed: " if trial.met is False else ""
    worst = "" if math.isnan(trial.worst) else f" ({_number(trial.worst)})"
    return f"{missed}{_number(trial.value)}{worst} {_unit(trial.unit)}".strip()


def _number(value: float) -> str:
    return "none to Nyquist" if math.isinf(value) else words.number(value, 3)


def _unit(unit: str) -> str:
    return {"1": "", "deg": "°"}.get(unit, words.unit(unit))


def compensation_rows(study: Study) -> Rows:
    """Return effect, sine, and at each rate the error without and with its compensation, and the gain."""

    def shown(c: Compensated) -> str:
        gain = f"gain {round(c.gain, 2) + 0.0:.2f}"
        return words.minus(f"{100 * c.without:.2f} → {100 * c.with_model:.2f} %, {gain}")

    return [
        [words.sentence(words.effect(cells[0].effect.name)), f"{cells[0].hz:g} Hz", *map(shown, cells)]
        for cells in zip(*(at.compensations for at in study.rates), strict=True)
    ]


def reach_rows(study: Study) -> Rows:
    """Return for each motor and amplitude where the clamped and the free actuator can no longer track it."""
    return [
        [motor.name, f"{locked.amplitude:g} N·m", _reach(locked), _reach(free)]
        for motor, rows in study.reaches.items()
        for locked, free in rows
    ]


def _reach(reach: Reach) -> str:
    if math.isinf(reach.hz):
        return "tracked to 400 Hz"
    (_, by), (further, other) = sorted([(reach.torque, "torque"), (reach.speed, "speed")], key=lambda x: x[0])
    also = "" if math.isinf(further) else f"; {other} {words.number(further, 3)} Hz"
    return f"{words.number(reach.hz, 3)} Hz ({by}{also})"


def gains_words(study: Study) -> Sequence[str]:
    """Return the gains of each rate, a line each."""
    return [
        words.minus(
            f"{design.rate:g} Hz: k_p = {g.k_p:.3f}, k_d = {1e3 * g.k_d:.2f} ms, k_i = {g.k_i:.2f}, Q "
            f"{g.q_frequency:.1f} Hz, k_w = {g.k_w:.1f} N·m·s/rad"
        )
        for design, g in ((at.design, at.design.gains) for at in study.rates)
    ]


def control_tables(study: Study) -> list[Html]:
    """Return the sections of the page that are tables."""
    columns = [f"#{rate}" for rate in rates(study)]
    margins = [
        [f"{at.design.rate:g} Hz", typeset(name), f"{m.crossover:.1f} Hz", words.minus(f"{m.phase:.1f}°"),
         words.minus(f"{m.gain:.1f} dB"), f"{m.delay:.2f}", f"{m.sensitivity:.2f}"]
        for at in study.rates for name, m in at.design.margins.items()
    ]  # fmt: skip
    head = ["rate", "load", "#crossover", "#phase margin", "#gain margin", "#delay, samples", "#max |S|"]
    return [
        section("Trials", table(["trial", "#required", *columns], trial_rows(study))),
        section(
            "Gain of each compensation",
            table(["effect", "#sine of 10 N·m", *columns], compensation_rows(study)),
            caption="RMS error of a sine over its own RMS, without and with the effect in the model.",
        ),
        section("Gains and margins", table(head, margins)),
        section(
            "Large signals",
            table(REACH_HEAD, reach_rows(study)),
            caption="From this frequency on, a sine needs more torque or speed than the motor has.",
        ),
    ]


def control_json(study: Study) -> dict[str, Any]:
    """Return the result file. SI; null where a number is infinite."""
    reach = "torque_hz=torque speed_hz=speed"
    return {
        "schema": 1,
        "rig": study.rig.name,
        **pick(study, "open_loop_resonance_hz=resonance"),
        "rates": [_at_rate(at) for at in study.rates],
        "large_signal": [
            {
                **pick(motor, "motor=name torque speed source"),
                "limits": [
                    {**pick(locked, "amplitude"), "locked": pick(locked, reach), "free": pick(free, reach)}
                    for locked, free in rows
                ],
            }
            for motor, rows in study.reaches.items()
        ],
    }


def _at_rate(at: AtRate) -> dict[str, Any]:
    z = at.impedance
    return {
        **pick(at.design, "rate_hz=rate gains margins friction_left"),
        "set": {
            **pick(at.swept, "cases unstable sensitivity"),
            "where": str(at.swept.where),
            **pick(at.swept, "margins"),
        },
        "trials": [pick(t, "what value unit asked worst asked_worst=allowed met") for t in at.trials],
        "compensation": [
            pick(c, "effect=effect.name parameters=effect.parameters sine_hz=hz error_without=without "
                 "error_with=with_model gain")
            for c in at.compensations
        ],
        "output_impedance": {
            **pick(z, "hz"),
            **{n: np.abs(getattr(z, n)).tolist() for n in ("controlled", "motor_off", "spring")},
        },
    }  # fmt: skip
