"""This project on the records of docs/peers.md: `diagnose` on the training samples, then a free run.

The rows of other programs there were played in environments made by hand, by what commit 906e2112 has.
"""

import math
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from bench.peers.cases import REAL, SIMULATED, PeerRecord
from bench.results import Row
from rsea_ros.diagnosis.diagnose import diagnose
from rsea_ros.errors import RigError
from rsea_ros.model.rig import Rig
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import simulate
from rsea_ros.records.record import Channel, FloatArray, Record

RIG_OF = {"sea": "paper_high_impedance", "joint": "pendulum", "drive": "emps"}
PARAMETERS = {
    "inertia": ("rotor.reflected_inertia", "chassis.inertia", "spring_end.inertia"),
    "damping": ("rotor.reflected_damping", "spring.damping", "spring_end.damping"),
    "stiffness": ("spring.stiffness",),
    "gravity": ("spring_end.gravity",),
}
"""The sums of a rig's values that a value of a joint is."""


class Result(NamedTuple):
    """y from `split` on, the values that the rig states, the causes, the verdict."""

    prediction: FloatArray
    values: dict[str, float]
    cause: str
    note: str


def main(*, cases: tuple[str, ...] = (), realdata: Path | None = None) -> Iterator[Row]:
    """Play the cases, and print the table.

    cases: names of cases, all where none is named
    realdata: folder with emps; without it that case is left out
    """
    made = [make() for make in SIMULATED] + [make(realdata) for make in REAL if realdata]
    for case in (c for c in made if not cases or c.name in cases):
        started = time.process_time()
        result = diagnosed(case)
        yield row(case, result, time.process_time() - started)


def diagnosed(case: PeerRecord) -> Result:
    """Diagnose the samples before `split` and predict those behind it."""
    rig = load_rig(RIG_OF[case.physics])
    rig = replace(rig, controller=None) if case.physics == "drive" else rig
    result = diagnose([record_of(case, case.split)], rig)
    run = simulate(result.extended_rig, record_of(case, len(case.u)))[case.channel]
    values = {n: sum(_value(result.extended_rig, p) for p in parts) for n, parts in PARAMETERS.items()}
    said = "; ".join(f"{c.name} ({c.status}, {c.probability:.2f})" for c in result.causes)
    return Result(run[case.split :], {n: v for n, v in values.items() if v}, said, result.verdict)


def _value(rig: Rig, name: str) -> float:
    try:
        return float(rig[name])
    except RigError:  # this rig has no such part
        return 0.0


def record_of(case: PeerRecord, n: int) -> Record:
    """Return the first n samples: a command at the beginning of its period, measurements at its end, nothing
    measured from `split` on."""
    starts = np.arange(n) / case.rate
    channels = {"command": Channel(starts, case.u[:n])}
    if case.physics != "sea":
        channels["motor_torque"] = Channel(starts, case.u[:n])
    for name, y in {"position": case.position, "velocity": case.velocity, case.channel: case.y}.items():
        if y.size:
            channels[name] = Channel(starts + 1.0 / case.rate, y[:n] if n == case.split else np.zeros(n))
    return Record(channels, case.name)


def row(case: PeerRecord, result: Result, seconds: float) -> Row:
    """Return the row of a result."""
    held_out = case.y[case.split :]
    rms = float(np.sqrt(np.mean((result.prediction - held_out) ** 2)))
    off = [result.values[n] / true - 1.0 for n, true in case.truth.items() if n in result.values]
    return Row(case.name, "", {
        "peer": "rsea", "residual / noise": _number(rms / case.noise),
        "fit, %": _number(100.0 * (1.0 - rms / float(held_out.std()))),
        "values off, %": _number(100.0 * float(np.sqrt(np.mean(np.square(off)))) if off else math.nan),
        "cause": result.cause or "none named", "s": f"{seconds:.1f}", "note": result.note,
    })  # fmt: skip


def _number(value: float) -> str:
    return f"{value:.3g}" if math.isfinite(value) else "–"
