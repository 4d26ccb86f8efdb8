"""The same actuator held by either end, with any train, lumped or not: transfer functions and limits.

With both ends clamped, n the train's ratio, J_r = J_m / N^2 and Z = J s^2 + b_s s + K_s:

    T_d / T_m = (b_s s + K_s) / den       T-RSEA, the gear beside the spring; RT-RSEA exchanges T_d and T_p
    T_p / T_m = Z(J_inner) / den          J_inner = J_sc + n J_r   (lumped: J_sc + n^2 J_r)
    den = (J_sc + n^2 J_r) s^2 + (b_m + b_s) s + K_s
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rsea_ros.model import outputs
from rsea_ros.model.bandwidth import inner_inertia
from rsea_ros.model.equations import rotor_inertia, train_ratio
from rsea_ros.model.rig import END_NAMES, Rig
from rsea_ros.model.train import TRAINS, Train
from rsea_ros.model.transfer import frequency_response
from rsea_ros.paper import formulas
from rsea_ros.records.record import ComplexArray, FloatArray

HZ: FloatArray = np.geomspace(0.5, 140.0, 60)


@dataclass(frozen=True)
class Arrangement:
    """A train with both ends clamped. ratio: n. outer, inner: kg m^2 of den and of T_p's numerator."""

    train: Train
    ratio: float
    outer: float
    inner: float


@dataclass(frozen=True)
class Limit:
    """Something that one model becomes. errors: largest relative difference, 0.5 to 140 Hz, at each value."""

    what: str
    of: str
    values: tuple[float, ...]
    errors: tuple[float, ...]


def arrangements(rig: Rig) -> tuple[Arrangement, ...]:
    """Return the rig's inertias with each train."""
    return tuple(_arrangement(replace(rig, train=train)) for train in TRAINS)


def _arrangement(rig: Rig) -> Arrangement:
    n, j_r, j_sc = train_ratio(rig), rotor_inertia(rig), rig["chassis.inertia"]
    outer = j_sc + n**2 * j_r
    return Arrangement(rig.train, n, outer, inner_inertia(rig))


def limits(rig: Rig) -> tuple[Limit, ...]:
    """Return the limits in which the models of a rig with a free housing meet."""
    clamped = replace(rig, clamped=frozenset(END_NAMES))
    lumped, star = replace(clamped, train="lumped"), replace(clamped, train="star")
    return (
        Limit("Both ends clamped: T_d/T_m lumped is T_d/T_m unlumped", "", (1.0,), (_off(lumped, clamped),)),
        _limit("A heavy load is a clamp: T_d/T_m of the free housing becomes Eq. (4)", "load, kg·m²",
               (1e2, 1e4, 1e6), lambda v: _off(rig.with_values({"housing_end.inertia": v}), clamped)),
        _limit("A large ratio at the same J_m: T_p/T_m becomes Eq. (5), planetary", "N",
               (5e1, 5e3, 5e5), lambda v: _off_eq_5(clamped.with_values({"gear.ratio": v}))),
        _limit("A large ratio at the same J_m: T_p/T_m becomes Eq. (5), star", "N",
               (5e1, 5e3, 5e5), lambda v: _off_eq_5(star.with_values({"gear.ratio": v}))),
        _limit("A large ratio: star and planetary train are one, housing free", "N",
               (5e1, 5e3, 5e5), lambda v: _trains_apart(rig.with_values({"gear.ratio": v}))),
        _limit("A stiff spring: T_d/T_p becomes 1", "K_s, N·m/rad",
               (1e6, 1e8, 1e10), lambda v: _end_to_end_off(clamped.with_values({"spring.stiffness": v}))),
    )  # fmt: skip


def _limit(what: str, of: str, values: Sequence[float], error: Callable[[float], float]) -> Limit:
    return Limit(what, of, tuple(values), tuple(error(v) for v in values))


def _distal(rig: Rig) -> ComplexArray:
    return frequency_response(rig, outputs.end_torque(rig, "spring_end"), HZ)


def _proximal(rig: Rig) -> ComplexArray:
    return frequency_response(rig, outputs.end_torque(rig, "housing_end"), HZ)


def _off(rig: Rig, other: Rig) -> float:
    return _worst(_distal(rig), _distal(other))


def _off_eq_5(rig: Rig) -> float:
    ratio = rig["gear.ratio"]
    rotor = rig["rotor.reflected_inertia"] / ratio**2, rig["rotor.reflected_damping"] / ratio**2
    eq_5 = formulas.eq_5_proximal_per_motor(
        rig["spring.stiffness"], *rotor, ratio, rig["chassis.inertia"], rig["spring.damping"]
    )
    return _worst(_proximal(rig), eq_5(2j * np.pi * HZ))


def _trains_apart(rig: Rig) -> float:
    return _worst(_distal(replace(rig, train="star")), _distal(replace(rig, train="planetary")))


def _end_to_end_off(rig: Rig) -> float:
    return _worst(_distal(rig) / _proximal(rig), np.ones(len(HZ), complex))


def _worst(ours: ComplexArray, expected: ComplexArray) -> float:
    return float(np.max(np.abs(ours / expected - 1.0)))
