"""Equations of motion of the unlumped actuator, for any rig.

Coordinates (absolute angles, rad): h housing, g gear output before the gear's own compliance,
c spring chassis, d distal output. The rotor turns at

    w_rotor = w_h + n (w_g - w_h),   n = N (planetary) or -(N - 1) (star: annulus and carrier exchanged)

so with J_r = J_m / N^2 the kinetic energy

    1/2 J_h w_h^2 + 1/2 J_sc w_c^2 + 1/2 J_r w_rotor^2 + 1/2 J_d w_d^2

makes the rotor an inerter between housing and gear output (facts.md section 1). A clamped end, a rigid
spring (d = c) and a stiff gear (c = g) are constraints q_full = P q, so M = P' M_full P and so on.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rsea_ros.errors import RigError
from rsea_ros.model.rig import Rig
from rsea_ros.signals import FloatArray

H, G, C, D = range(4)

PORTS = ("gear", "spring", "joint", "housing", "distal")
"""Where a torque can act. gear: on the gear output against the housing (the motor's torque acts here);
spring: in the spring, positive when it pushes the distal side forward; joint: between gear output and
chassis, positive when it pushes the chassis forward; housing, distal: from outside on that end."""

_PORT_DIRECTIONS = np.array(
    [
        [-1.0, 1.0, 0.0, 0.0],
        [0.0, 0.0, -1.0, 1.0],
        [0.0, -1.0, 1.0, 0.0],
        [1.0, 0.0, 0.0, 0.0],
        [0.0, 0.0, 0.0, 1.0],
    ]
)


@dataclass(frozen=True)
class Mechanics:
    """M q'' + D q' + K q = B' tau, with tau the torques at PORTS.

    mass, damping, stiffness: shape (n, n). ports: B, shape (5, n). placement: P, shape (4, n).
    """

    mass: FloatArray
    damping: FloatArray
    stiffness: FloatArray
    ports: FloatArray
    placement: FloatArray

    @property
    def order(self) -> int:
        """Number of coordinates that can move."""
        return int(self.mass.shape[0])


def train_ratio(rig: Rig) -> float:
    """Return n of w_rotor = w_h + n (w_g - w_h)."""
    return rig["gear.ratio"] if rig.train == "planetary" else -(rig["gear.ratio"] - 1.0)


def rotor_inertia(rig: Rig) -> float:
    """Return J_r = J_m / N^2, kg m^2, what the rotor has on its own axis."""
    return rig["rotor.reflected_inertia"] / rig["gear.ratio"] ** 2


def mechanics(rig: Rig, *, linear_gravity: bool = True) -> Mechanics:
    """Return the equations of motion of a rig.

    linear_gravity: count a pendulum's m g l as a stiffness, as small angles allow; the simulation
    leaves it out here and adds m g l sin(theta) itself.
    """
    placement = _placement(rig)
    mass = placement.T @ _full_mass(rig) @ placement
    if np.linalg.eigvalsh(mass).min() <= 0.0:
        raise RigError(f"rig {rig.name}: the mass matrix is singular, expected an inertia on every part that can move")
    return Mechanics(
        mass=mass,
        damping=placement.T @ _full_damping(rig) @ placement,
        stiffness=placement.T @ _full_stiffness(rig, linear_gravity) @ placement,
        ports=_PORT_DIRECTIONS @ placement,
        placement=placement,
    )


def _placement(rig: Rig) -> FloatArray:
    """Return P of q_full = P q: one column for each coordinate that moves on its own."""
    owner = {H: H, G: G, C: G if math.isinf(rig["gear.stiffness"]) else C, D: D}
    if rig.rigid_spring:
        owner[D] = owner[C]
    fixed = {owner[coordinate] for coordinate, end in ((H, "housing_end"), (D, "spring_end")) if end in rig.clamped}
    moving = [c for c in sorted(set(owner.values())) if c not in fixed]
    placement = np.zeros((4, len(moving)))
    for coordinate in (H, G, C, D):
        if owner[coordinate] in moving:
            placement[coordinate, moving.index(owner[coordinate])] = 1.0
    return placement


def _full_mass(rig: Rig) -> FloatArray:
    n, j_r = train_ratio(rig), rotor_inertia(rig)
    mass = np.zeros((4, 4))
    mass[np.ix_((H, G), (H, G))] = j_r * np.array([[(1 - n) ** 2, n * (1 - n)], [n * (1 - n), n**2]])
    mass[C, C] += rig["chassis.inertia"]
    for coordinate, end in ((H, "housing_end"), (D, "spring_end")):
        if rig.end_is_free(end):
            mass[coordinate, coordinate] += rig[f"{end}.inertia"]
    return mass


def _full_damping(rig: Rig) -> FloatArray:
    damping = _between(H, G, rig["rotor.reflected_damping"]) + _between(C, D, rig["spring.damping"])
    damping[H, H] += rig["housing_end.damping"]
    damping[D, D] += rig["spring_end.damping"]
    return damping


def _full_stiffness(rig: Rig, linear_gravity: bool) -> FloatArray:
    stiffness = np.zeros((4, 4))
    if not rig.rigid_spring:
        stiffness += _between(C, D, rig["spring.stiffness"])
    if math.isfinite(rig["gear.stiffness"]):
        stiffness += _between(G, C, rig["gear.stiffness"])
    for coordinate, end in ((H, "housing_end"), (D, "spring_end")):
        gravity = rig[f"{end}.gravity"] if linear_gravity else 0.0
        stiffness[coordinate, coordinate] += rig[f"{end}.stiffness"] + gravity
    return stiffness


def _between(a: int, b: int, value: float) -> FloatArray:
    matrix = np.zeros((4, 4))
    matrix[np.ix_((a, b), (a, b))] = value * np.array([[1.0, -1.0], [-1.0, 1.0]])
    return matrix
