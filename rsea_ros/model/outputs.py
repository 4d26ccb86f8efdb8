"""Outputs of the equations of motion: torques on the two ends, the spring, the encoder.

A torque on an end is the torque that the end holds, from its row of the equations of motion. Torques of
both ends are positive for positive motor torque: on the housing end backward, on the spring end forward. So

    T_p - T_d = (J_sc + n J_r) q_c''   with both ends clamped; n J_r = J_m / N for a planetary train

which Eqs. (5) and (6) have without n J_r, the spin of the rotor (docs/physics.md).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from rsea_ros.errors import RigError
from rsea_ros.model import equations
from rsea_ros.model.rig import Rig
from rsea_ros.records.record import FloatArray

Sees = Literal["spring_and_damper", "element"]
"""Torque at the spring end: K_s + b_s s, as a sensor in series with the spring has it, or K_s alone, the
element of Eqs. (1), (3), (4), (6). With b_s = 3 N m s/rad they differ by more than 20 degrees above 30 Hz."""


@dataclass(frozen=True)
class Output:
    """A signal y = (c_0 + c_1 s + c_2 s^2) q + d tau.

    c: shape (3, 5), on the coordinates (h, g, c, d, p) and their two derivatives. d: shape (5,), on the
    torques at equations.PORTS.
    """

    c: FloatArray
    d: FloatArray


def position() -> Output:
    """Return the gear output's angle against the housing, rad, as the encoder reads it."""
    return _of_coordinates({equations.C: 1.0, equations.H: -1.0})


def link() -> Output:
    """Return the angle of what hangs on the spring against the housing, rad."""
    return _of_coordinates({equations.D: 1.0, equations.H: -1.0})


def deflection() -> Output:
    """Return the spring's angle, rad."""
    return _of_coordinates({equations.C: 1.0, equations.D: -1.0})


def distal(rig: Rig, sees: Sees = "spring_and_damper") -> Output:
    """Return T_d, the torque on the end that is not the rig's `proximal`, N m."""
    return end_torque(rig, "housing_end" if rig.proximal == "spring_end" else "spring_end", sees)


def proximal(rig: Rig) -> Output:
    """Return T_p, the torque on the rig's `proximal` end, N m."""
    return end_torque(rig, rig.proximal)


def end_torque(rig: Rig, end: str, sees: Sees = "spring_and_damper") -> Output:
    """Return the torque on an end, N m. `sees` is about the spring end; the housing has no spring before it.

    Raises RigError for the element alone where the spring is rigid.
    """
    if end == "spring_end" and sees == "element":
        if rig.rigid_spring:
            what = "expected a spring with a stiffness to read its element"
            raise RigError(f"rig {rig.name}: spring.rigid = True, {what}")
        return Output(rig["spring.stiffness"] * deflection().c, np.zeros(len(equations.PORTS)))
    coordinate = next(c for c, name in equations.END_COORDINATES if name == end)
    owner = equations.owners(rig)
    rows = [c for c in owner if owner[c] == owner[coordinate]]
    sign = 1.0 if end == "housing_end" else -1.0
    matrices = equations.actuator_matrices(rig)
    mass, damping, stiffness = (sign * matrix[rows].sum(axis=0) for matrix in matrices)
    inside = np.isin(equations.PORTS, ("gear", "spring", "joint"))
    torques = equations.PORT_DIRECTIONS[:, rows].sum(axis=1) * inside
    return Output(np.array([stiffness, damping, mass]), -sign * torques)


def _of_coordinates(factors: Mapping[int, float]) -> Output:
    c = np.zeros((3, equations.COORDINATES))
    for coordinate, factor in factors.items():
        c[0, coordinate] = factor
    return Output(c, np.zeros(len(equations.PORTS)))
