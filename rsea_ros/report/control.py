"""A controlled actuator: torque tracking, output impedance, tables of trials and margins; control.json."""

import math
import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from rsea_ros.control.following import Following
from rsea_ros.control.robustness import Reach, Spread
from rsea_ros.control.study import AtRate, Compensated, Study, TrialResult
from rsea_ros.model.rig import Rig
from rsea_ros.model.transfer import end_response
from rsea_ros.report import words
from rsea_ros.report.figures import figure as fig
from rsea_ros.report.figures.response import Band, Mark, ResponseCurve, response_figure
from rsea_ros.report.page import Block, Html, bullets, key_numbers, page, section, table
from rsea_ros.report.result_files import Provenance, pick

_COLOURS = (fig.AFTER, fig.BEFORE, fig.TRUTH)

BAND = "Band: all benches of the set with that load ({}); the ringing of a mode is not in the torque."
LEARNING = (
    "Here the loads are half, once and twice the inertia. Slow or small motion teaches nothing of the load; "
    "then only feedback is left."
)


def control_report(study: Study, provenance: Provenance | None = None) -> str:
    """Return the page."""
    blocks: list[Block] = [
        key_numbers(_keys(study)), section("Gains", bullets(gains_words(study))), *_following(study),
        _impedance_figure(study), *control_tables(study),
    ]  # fmt: skip
    footer = [
        f"{m.name}: {m.torque:g} N·m, "
        f"{f'{m.speed:.3g} rad/s' if math.isfinite(m.speed) else 'speed not stated'} ({m.source})"
        for m in study.reaches
    ]
    footer.append("rsea control. All in SI. One sample of delay and the hold are in every number.")
    return page(verdict(study), f"Torque control · {study.rig.name}", blocks, footer, provenance)


def verdict(study: Study) -> str:
    """Return the verdict in a sentence."""
    every = [(at.design.rate, trial) for at in study.rates for trial in at.trials]
    missed = [f"{typeset(trial.what)} at {rate:g} Hz" for rate, trial in every if trial.met is False]
    reached = f"Stable on all {study.rates[0].swept.cases} benches of the set, from locked to free"
    if any(at.swept.unstable for at in study.rates):
        reached = "Unstable on part of the set"
    return f"{reached}; missed: {'; '.join(missed)}" if missed else f"{reached}, with every margin kept"


def _keys(study: Study) -> list[tuple[str, str]]:
    at, locked = study.rates[0], study.rates[0].design.margins["locked"]
    errors = [(f"{t.value:.1f} %", f"error, {t.what}") for t in at.trials if t.unit == "%"][:1]
    return [
        (f"{study.resonance:.1f} Hz", "open-loop resonance"),
        (f"{locked.crossover:.1f} Hz", f"crossover at {at.design.rate:g} Hz"),
        (words.minus(f"{locked.phase:.0f}°"), "phase margin, locked"),
        (words.minus(f"{at.swept.margins.phase:.0f}°"), "phase margin, worst"),
        *errors,
    ]


def _following(study: Study) -> list[fig.Figure]:
    """Return T_d over desired torque with its band over the set: clamped, and on an unknown free load."""
    first, rate = study.rates[0].free, f"{study.rates[0].design.rate:g} Hz"
    followed = np.nonzero(np.abs(first.gain) < 3.0)[0]
    free = "On an unknown free load small torques are not followed"
    if len(followed):
        ends = f"{first.hz[followed[0]]:g} to {first.bandwidth:.0f} Hz at {rate}"
        free = f"On an unknown free load small torques are followed from {ends}"
    reached = " and ".join(f"{at.locked.bandwidth:.0f} Hz at {at.design.rate:g} Hz" for at in study.rates)
    locked = f"Held at both ends, torque follows to {reached}"
    return [
        _following_figure(study, study.rig, locked, "locked"),
        _following_figure(study, study.free, free, "free", LEARNING),
    ]


def _following_figure(study: Study, rig: Rig, title: str, load: str, more: str = "") -> fig.Figure:
    curves = []
    for rate, at, colour in zip(rates(study), study.rates, _COLOURS, strict=False):
        c, apart = getattr(at, load), getattr(at, f"{load}_spread")
        curves.append(ResponseCurve(rate, colour, c.hz, c.torque, 2.0, "", _band(c, apart), c.phase))
    hz = np.geomspace(1.0, 0.45 * max(at.design.rate for at in study.rates), 300)
    opened = end_response(rig, hz)
    curves.append(ResponseCurve("without control", fig.MEASURED, hz, opened, 1.2, "dot"))
    caption = "Distal over desired torque, 1 N·m, sine by sine, in simulation. "
    caption = f"{caption}{BAND.format(study.rates[0].design.uncertainty)} {more}".strip()
    marks = [Mark(3.0 * study.resonance, "3 × resonance")]
    return response_figure(title, curves, marks, caption, (-50.0, 15.0))


def _band(curve: Following, apart: Spread) -> Band:
    """Return the band of a curve over the set, from its first sine to its last."""
    inside = (apart.hz >= curve.hz[0]) & (apart.hz <= curve.hz[-1])
    hz = apart.hz[inside]
    turned = np.interp(np.log(hz), np.log(curve.hz), curve.phase)
    low, high = (curve.gain_at(hz) + edge[inside] for edge in apart.gain)
    late, early = (turned + np.degrees(edge[inside]) for edge in apart.phase)
    return Band(hz, (low, high), (late, early))


def _impedance_figure(study: Study) -> fig.Figure:
    first, bands, lines = study.rates[0].impedance, [], []

    hover: fig.Json = {"hovertemplate": "%{y:.3g} N·m per rad/s"}
    for rate, at, colour in zip(rates(study), study.rates, _COLOURS, strict=False):
        bands.append(fig.band(at.softness.hz, at.softness.low, at.softness.high, fig.faint(colour, 0.18)))
        z = at.impedance
        lines.append(fig.line(z.hz, np.abs(z.controlled), rate, colour, 1.8, **hover))
    off, spring = np.abs(first.motor_off), np.abs(first.spring)
    lines.append(fig.line(first.hz, off, "motor off", fig.QUIET, 1.8, "dash", **hover))
    lines.append(fig.line(first.hz, spring, "passive spring", fig.MEASURED, 1.8, "dot", **hover))
    one = int(np.argmin(np.abs(first.hz - 1.0)))
    softer = abs(first.spring[one]) / abs(first.controlled[one])
    highest = max(float(at.impedance.hz[-1]) for at in study.rates)
    return fig.Figure(
        title=f"At 1 Hz the moved output is {softer:.0f} times softer than the spring alone",
        caption="Torque error for each rad/s of the distal side, housing clamped. Spring alone: K_s/s + b_s. "
        "Band: the locked benches of the set.",
        data=bands + lines,
        layout=fig.layout(
            xaxis=fig.frequency_axis(float(first.hz[0]), highest),
            yaxis=fig.axis("N·m per rad/s", type="log"),
            annotations=fig.names_beside(fig.named(lines), 0.08),
            margin={"l": 64, "r": 150, "t": 12, "b": 48},
        ),
        height=400,
    )


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
    """Return the gains of each rate, a line each, and the set that they tolerate."""
    sets = list(dict.fromkeys(str(at.design.uncertainty) for at in study.rates))
    mode = all(at.design.uncertainty.mode is None for at in study.rates)
    none = "; no mode of the F/T sensor's mount is assumed (--uncertainty states one)" if mode else ""
    return [
        words.minus(
            f"{design.rate:g} Hz: k_p = {g.k_p:.3f}, k_d = {1e3 * g.k_d:.2f} ms, k_i = {g.k_i:.2f}, Q "
            f"{g.q_frequency:.1f} Hz, k_w = {g.k_w:.1f} N·m·s/rad"
        )
        for design, g in ((at.design, at.design.gains) for at in study.rates)
    ] + [f"tolerated: {' or '.join(sets)}{none}"]


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
