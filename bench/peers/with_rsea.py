"""This project: `diagnose` on the training samples with the rig of the case, then a free run of its model."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from common import NotApplicable, PeerCase, PeerResult

sys.path.append(str(Path(__file__).resolve().parents[2]))

from rsea_ros.diagnosis.diagnose import diagnose
from rsea_ros.errors import RigError
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import simulate
from rsea_ros.records.record import Channel, Record

RIG_OF = {"sea": "paper_high_impedance", "joint": "pendulum", "drive": "emps"}
PARAMETERS = {
    "inertia": ("rotor.reflected_inertia", "chassis.inertia", "spring_end.inertia"),
    "damping": ("rotor.reflected_damping", "spring.damping", "spring_end.damping"),
    "stiffness": ("spring.stiffness",),
    "gravity": ("spring_end.gravity",),
}
"""The sums of a rig's values that a peer's value is."""


def rsea(case: PeerCase) -> PeerResult:
    """Diagnose and predict."""
    physics = case.meta["physics"]
    if physics not in RIG_OF:
        raise NotApplicable("no physics to diagnose")
    record = _record(case, case.split)
    rig = load_rig(RIG_OF[physics])
    result = diagnose([record], replace(rig, controller=None) if physics == "drive" else rig)
    channel = "ft" if physics == "sea" else "position"
    run = simulate(result.extended_rig, _record(case, len(case.u)))[channel]
    values = {n: sum(_value(result.extended_rig, p) for p in parts) for n, parts in PARAMETERS.items()}
    said = [f"{c.name} ({c.status}, {c.probability:.2f})" for c in result.causes]
    shown = {n: v for n, v in values.items() if v and (n in case.meta["stated"])}
    return PeerResult(run[case.split :], shown, "; ".join(said), result.verdict)


def _value(rig, name: str) -> float:
    try:
        return float(rig[name])
    except RigError:  # this rig has no such part
        return 0.0


def _record(case: PeerCase, n: int) -> Record:
    """Return the first n samples: a command at the beginning of its period, measurements at its end."""
    starts, ends = case.t[:n], case.t[:n] + case.period
    blank = np.zeros(n)
    channels = {"command": Channel(starts, case.u[:n])}
    if case.meta["physics"] != "sea":
        channels["motor_torque"] = Channel(starts, case.u[:n])
    known = {"position": case.position, "velocity": case.velocity}
    known |= {"ft" if case.meta["physics"] == "sea" else "position": case.y}
    for name, y in known.items():
        if y.size:
            channels[name] = Channel(ends, y[:n] if n == case.split else blank)
    return Record(channels, case.meta["name"])
