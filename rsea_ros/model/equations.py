"""Equations of motion of the unlumped actuator, for any rig; effects that change its structure.

Coordinates (absolute angles, rad): h housing, g gear output before the gear's own compliance,
c spring chassis, d distal output, p load on the housing's end. The rotor turns at

    w_rotor = w_h + n (w_g - w_h),   n by the kind of train (train.py): N for a planetary one
    w_rotor = N w_g                  (lumped: grounded, as if the housing's motion did not turn it)

so with J_r = J_m / N^2 the kinetic energy

    1/2 J_h w_h^2 + 1/2 J_sc w_c^2 + 1/2 J_r w_rotor^2 + 1/2 J_d w_d^2

makes the rotor an inerter between housing and gear output (docs/derivation.md). A clamped end, a rigid
spring (d = c), a stiff gear (c = g) and no spring on the proximal side (p = h) are constraints
q_full = P q, so M = P' M_full P and so on.
"""

import math
from dataclasses import dataclass

import numpy as np

from rsea_ros.effects.catalogue import effect_named
from rsea_ros.errors import RigError
from rsea_ros.model.rig import Rig
from rsea_ros.model.train import rotor_turns
from rsea_ros.records.record import FloatArray


def with_structure(rig: Rig) -> Rig:
    """Return the rig with the changes of structure by its effects (a compliant gear or base).

    Raises ParameterError for wrong parameters, and for an effect that this rig cannot have.
    """
    for setting in rig.effects:
        effect = effect_named(setting.name)
        effect.vector(setting.parameters)
        if effect.structure is not None:
            rig = effect.structure(rig, effect.complete(setting.parameters))
    return rig


H, G, C, D, P = range(5)
COORDINATES = 5
END_COORDINATES = ((P, "housing_end"), (D, "spring_end"))

PORTS = ("gear", "spring", "joint", "housing", "distal")
"""Where a torque can act. gear: on the gear output against the housing (the motor's torque acts here);
spring: in the spring, positive when it pushes the distal side forward; joint: between gear output and
chassis, positive when it pushes the chassis forward; housing, distal: from outside on that end."""

PORT_DIRECTIONS = np.array(
    [
        [-1.0, 1.0, 0.0, 0.0, 0.0],
        [0.0, 0.0, -1.0, 1.0, 0.0],
        [0.0, -1.0, 1.0, 0.0, 0.0],
        [0.0, 0.0, 0.0, 0.0, 1.0],
        [0.0, 0.0, 0.0, 1.0, 0.0],
    ]
)


@dataclass(frozen=True)
class Mechanics:
    """M q'' + D q' + K q = B' tau, with tau the torques at PORTS.

    mass, damping, stiffness: shape (n, n). ports: B, shape (5, n). placement: P, shape (5, n).
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
    """Return n, the rotor's turns for one of the part beside the spring, both against the other part."""
    return rotor_turns(rig.train, rig["gear.ratio"], rig.beside_spring)


def rotor_inertia(rig: Rig) -> float:
    """Return J_r = J_m / N^2, kg m^2, the rotor's inertia about its axis."""
    return rig["rotor.reflected_inertia"] / rig["gear.ratio"] ** 2


def gear_inertia(rig: Rig) -> float:
    """Return n^2 J_r, kg m^2: the rotor's inertia at the gear output, the housing held."""
    return float(rig["rotor.reflected_inertia"]) * (train_ratio(rig) / rig["gear.ratio"]) ** 2


def mechanics(rig: Rig, *, linear_gravity: bool = True) -> Mechanics:
    """Return the equations of motion of a rig.

    linear_gravity: count a pendulum's m g l as a stiffness, as small angles allow; the simulation
    leaves it out here and adds m g l sin(theta + gravity_angle) itself.
    """
    placement = _placement(rig)
    mass, damping, stiffness = (
        placement.T @ (inside + load) @ placement
        for inside, load in zip(actuator_matrices(rig), _load_matrices(rig, linear_gravity), strict=True)
    )
    if (mass[0, 0] if len(mass) == 1 else np.linalg.eigvalsh(mass).min()) <= 0.0:
        raise RigError(
            f"rig {rig.name}: the mass matrix is singular, expected an inertia on every part that can move"
        )
    return Mechanics(mass, damping, stiffness, PORT_DIRECTIONS @ placement, placement)


def owners(rig: Rig) -> dict[int, int]:
    """Return which coordinate each one moves with (a stiff gear, a rigid spring, no proximal spring)."""
    owner = {H: H, G: G, C: G if math.isinf(rig["gear.stiffness"]) else C, D: D}
    owner[P] = H if math.isinf(rig["proximal_spring.stiffness"]) else P
    if rig.rigid_spring:
        owner[D] = owner[C]
    return owner


def _placement(rig: Rig) -> FloatArray:
    """Return P of q_full = P q: one column for each coordinate that moves on its own."""
    owner = owners(rig)
    fixed = {owner[end] for end, name in END_COORDINATES if name in rig.clamped}
    moving = [c for c in sorted(set(owner.values())) if c not in fixed]
    placement = np.zeros((COORDINATES, len(moving)))
    for coordinate, leader in owner.items():
        if leader in moving:
            placement[coordinate, moving.index(leader)] = 1.0
    return placement


def actuator_matrices(rig: Rig) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return mass, damping and stiffness of all that is between the two ends, shape (5, 5) each."""
    mass, stiffness = np.zeros((COORDINATES, COORDINATES)), np.zeros((COORDINATES, COORDINATES))
    n = train_ratio(rig)
    rotor = np.array([0.0 if rig.train == "lumped" else 1.0 - n, n])  # its speed by those of h and g
    mass[H : G + 1, H : G + 1] = rotor_inertia(rig) * np.outer(rotor, rotor)
    mass[C, C] += rig["chassis.inertia"]
    mass[H, H] += rig["housing.inertia"]
    damping = _between(H, G, rig["rotor.reflected_damping"]) + _between(C, D, rig["spring.damping"])
    if not rig.rigid_spring:
        stiffness += _between(C, D, rig["spring.stiffness"])
    if math.isfinite(rig["gear.stiffness"]):
        stiffness += _between(G, C, rig["gear.stiffness"])
        damping += _between(G, C, rig["gear.damping"])
    if math.isfinite(rig["proximal_spring.stiffness"]):
        stiffness += _between(P, H, rig["proximal_spring.stiffness"])
        damping += _between(P, H, rig["proximal_spring.damping"])
    return mass, damping, stiffness


def _load_matrices(rig: Rig, linear_gravity: bool) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return mass, damping and stiffness of the loads on the ends."""
    mass, damping, stiffness = (np.zeros((COORDINATES, COORDINATES)) for _ in range(3))
    for end, name in END_COORDINATES:
        if rig.end_is_free(name):
            gravity = rig[f"{name}.gravity"] if linear_gravity else 0.0
            gravity *= math.cos(rig[f"{name}.gravity_angle"])
            mass[end, end] = rig[f"{name}.inertia"]
            damping[end, end] = rig[f"{name}.damping"]
            stiffness[end, end] = rig[f"{name}.stiffness"] + gravity
    return mass, damping, stiffness


def _between(a: int, b: int, value: float) -> FloatArray:
    matrix = np.zeros((COORDINATES, COORDINATES))
    matrix[a, a] = matrix[b, b] = value
    matrix[a, b] = matrix[b, a] = -value
    return matrix
