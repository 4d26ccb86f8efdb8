"""Tables of a controlled actuator: trials, gains and margins, compensations, limits."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

from rsea_ros.control.large_signal import Reach
from rsea_ros.control.study import Study
from rsea_ros.control.trials import Compensated, TrialResult
from rsea_ros.report import words
from rsea_ros.report.page.html import section
from rsea_ros.report.page.html_table import table

Rows = list[list[str]]

_SIGNS = {True: "≥", False: "≤"}


def trial_rows(study: Study) -> Rows:
    """Return each trial with its demand and its value at every rate; a value that misses it is marked."""
    return [
        [typeset(trials[0].what), demand_text(trials[0]), *(value(trial) for trial in trials)]
        for trials in zip(*(at.trials for at in study.rates), strict=True)
    ]


def trial_head(study: Study) -> list[str]:
    """Return the heading of `trial_rows`."""
    return ["trial", "required", *(f"{at.design.rate:g} Hz" for at in study.rates)]


def typeset(name: str) -> str:
    """Return the name of a trial or of a load with proper signs, `free x 0.5` as `free × 0.5`."""
    return re.sub(r"(?<!\w)-(?=\d)", "−", name.replace(" x ", " × "))


def demand_text(trial: TrialResult) -> str:
    """Return the demand in words."""
    limits = [words.number(limit, 3) for limit in (trial.asked, trial.allowed) if limit is not None]
    if not limits:
        return ""
    worst = f" (worst {limits[-1]})" if trial.allowed is not None and len(limits) > 1 else ""
    return f"{_SIGNS[trial.least]} {limits[0]}{worst} {_unit(trial.unit)}".strip()


def value(trial: TrialResult) -> str:
    """Return the value with its unit and that of the worst case, and `missed` in front of one that
    misses its demand."""
    missed = "missed: " if trial.met is False else ""
    worst = "" if math.isnan(trial.worst) else f" ({_number(trial.worst)})"
    return f"{missed}{_number(trial.value)}{worst} {_unit(trial.unit)}".strip()


def _number(value: float) -> str:
    return "none to Nyquist" if math.isinf(value) else words.number(value, 3)


def compensation_rows(study: Study) -> Rows:
    """Return effect, sine, and at each rate the error without and with its compensation, and the gain."""
    return [
        [
            words.sentence(words.effect(cells[0].effect.name)),
            f"{cells[0].hz:g} Hz",
            *(words.minus(_compensation(c)) for c in cells),
        ]
        for cells in zip(*(at.compensations for at in study.rates), strict=True)
    ]


def _compensation(c: Compensated) -> str:
    return f"{100 * c.without:.2f} → {100 * c.with_model:.2f} %, gain {round(c.gain, 2) + 0.0:.2f}"


def margin_rows(study: Study) -> Rows:
    """Return rate, load, crossover, margins."""
    return [
        [
            f"{at.design.rate:g} Hz",
            typeset(name),
            f"{m.crossover:.1f} Hz",
            words.minus(f"{m.phase:.1f}°"),
            words.minus(f"{m.gain:.1f} dB"),
            f"{m.delay:.2f}",
            f"{m.sensitivity:.2f}",
        ]
        for at in study.rates
        for name, m in at.design.margins.items()
    ]


def reach_rows(study: Study) -> Rows:
    """Return for each motor and amplitude where the clamped and the free actuator can no longer track it."""
    return [
        [motor.name, f"{locked.amplitude:g} N·m", reach_words(locked), reach_words(free)]
        for motor, rows in study.reaches.items()
        for locked, free in rows
    ]


def reach_words(reach: Reach) -> str:
    """Return a limit in words."""
    if math.isinf(reach.hz):
        return "tracked to 400 Hz"
    by = "torque" if reach.torque <= reach.speed else "speed"
    other = max(reach.torque, reach.speed)
    also = (
        ""
        if math.isinf(other)
        else f"; {'speed' if by == 'torque' else 'torque'} {words.number(other, 3)} Hz"
    )
    return f"{words.number(reach.hz, 3)} Hz ({by}{also})"


def gains_words(study: Study) -> Sequence[str]:
    """Return the gains of each rate, a line each."""
    gains = [(at.design, at.design.gains) for at in study.rates]
    return [
        words.minus(
            f"{design.rate:g} Hz: k_p = {g.k_p:.3f}, k_d = {1e3 * g.k_d:.2f} ms, k_i = {g.k_i:.2f}, "
            f"Q {g.q_frequency:.1f} Hz, k_w = {g.k_w:.1f} N·m·s/rad"
        )
        for design, g in gains
    ]


def control_tables(study: Study) -> list[str]:
    """Return the sections of the page that are tables."""
    rates = [f"{at.design.rate:g} Hz" for at in study.rates]
    columns = range(1, 8)
    margin_head = ["rate", "load", "crossover", "phase margin", "gain margin", "delay, samples", "max |S|"]
    return [
        section("Trials", table(trial_head(study), trial_rows(study), columns)),
        section(
            "Gain of each compensation",
            table(["effect", "sine of 10 N·m", *rates], compensation_rows(study), columns),
            caption="RMS error of a sine over its own RMS, without and with the effect in the model.",
        ),
        section("Gains and margins", table(margin_head, margin_rows(study), range(2, 8))),
        section(
            "Large signals",
            table(["motor", "amplitude", "clamped: limit from", "free: limit from"], reach_rows(study)),
            caption="From this frequency on, a sine needs more torque or speed than the motor has.",
        ),
    ]


def _unit(unit: str) -> str:
    return {"1": "", "deg": "°"}.get(unit, words.unit(unit))
