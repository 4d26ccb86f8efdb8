"""A bench that is simulated, with the true torques on both ends, got without the observer's output equations.

T_h is what the load on the housing's end feels, from its motion: T_h = -(J w' + b w + K q + m g l sin(q));
where that end is clamped, from the momentum of what is between the ends: T_h = T_s + (J_sc + n J_r) q_c''.
Means over each of the last two steps before a stamp (0.45 ms at most), drawn on to it. T_s: the spring, its
effects included. A spring before the housing's end is read instead. Which of the two is T_d, the rig says.
"""

import math
from dataclasses import dataclass

import numpy as np

from rsea_ros.effects import signal_table as st
from rsea_ros.model.drive import steps_per_sample
from rsea_ros.model.equations import C, H, P, mechanics, with_structure
from rsea_ros.model.rig import Rig
from rsea_ros.model.simulation import Machine, build, measure, run
from rsea_ros.model.transfer import inner_inertia
from rsea_ros.records.record import Channel, FloatArray, Record


@dataclass(frozen=True)
class Truth:
    """A record as the bench logged it, and the true torques at its measurements, N m."""

    record: Record
    distal: FloatArray
    proximal: FloatArray


def true_run(rig: Rig, command: FloatArray, rate: float, seed: int = 0) -> Truth:
    """Simulate a rig on a command (N m, one a sample) and return what was measured and what was true."""
    count = max(2, steps_per_sample(1.0 / rate))
    h, n = 1.0 / rate / count, len(command)
    machine, changed = build(rig, h, n / rate), with_structure(rig)
    placement = mechanics(changed).placement
    out, rows = np.empty((count, 4)), np.empty((n, 4))
    spring, housing, sprung = np.empty(n), np.empty(n), math.isfinite(rig["proximal_spring.stiffness"])
    for k, torque in enumerate(command):
        means = []
        for i in range(count):
            before, held = machine.x.copy(), _spring(machine)
            run(machine, np.full(1, torque), out[i : i + 1], start=k / rate + i * h)
            mean = 0.5 * (held + _spring(machine))
            means.append(_housing(changed, placement, before, machine.x, h, mean))
        rows[k], spring[k] = out[-1], _spring(machine)
        housing[k] = means[-1] if sprung else 1.5 * means[-1] - 0.5 * means[-2]
    t, rng = np.arange(n) / rate, np.random.default_rng(seed)
    names = ("position", "velocity", "motor_torque", "ft")
    measured = {
        m: Channel(t + 1.0 / rate, measure(rig, m, rows[:, i].copy(), rng)) for i, m in enumerate(names)
    }
    if rig.rigid_spring or "ft" not in rig.sensors:
        measured.pop("ft")
    record = Record({"command": Channel(t, command), **measured}, source=rig.name)
    held = rig.proximal == "housing_end"
    return Truth(record, spring, housing) if held else Truth(record, housing, spring)


def _spring(machine: Machine) -> float:
    return float(machine.linear.outputs[2] @ machine.x + machine.table[st.SPRING_TORQUE])


def _housing(
    rig: Rig, placement: FloatArray, a: FloatArray, b: FloatArray, h: float, spring: float
) -> float:
    """Return T_h from the states before and after a step of h seconds."""
    half = placement.shape[1]
    angle, speed = placement @ (a + b)[:half] / 2.0, placement @ (a + b)[half:] / 2.0
    rate = placement @ (b - a)[half:] / h
    if math.isfinite(rig["proximal_spring.stiffness"]):
        angle, speed = placement @ b[:half], placement @ b[half:]
        twist, turn = angle[P] - angle[H], speed[P] - speed[H]
        return float(rig["proximal_spring.stiffness"] * twist + rig["proximal_spring.damping"] * turn)
    if not rig.end_is_free("housing_end"):
        return spring + inner_inertia(rig) * float(rate[C])
    inertia, damping, stiffness, weight, hanging = (
        rig[f"housing_end.{name}"] for name in ("inertia", "damping", "stiffness", "gravity", "gravity_angle")
    )
    held = stiffness * angle[P] + weight * math.sin(angle[P] + hanging)
    return -float(inertia * rate[P] + damping * speed[P] + held)
