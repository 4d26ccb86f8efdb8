"""Up to which frequency and amplitude an actuator is a pure torque source: Eq. (7) and the exact bands.

And the same actuator held by either end, with any train, lumped or not. With both ends clamped, n the rotor's
turns for one of the part beside the spring (the gear in a T-RSEA, the motor's housing in an RT-RSEA, where n
is 1 less that of the train), J_sc that part's inertia, J_r = J_m / N^2 and Z = J s^2 + b_s s + K_s:

    T_d / T_m = (b_s s + K_s) / den
    T_p / T_m = Z(J_inner) / den          J_inner = J_sc + n J_r   (lumped: J_sc + n^2 J_r)
    den = (J_sc + n^2 J_r) s^2 + (b_m + b_s) s + K_s
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from rsea_ros.design.spring_design import band_range
from rsea_ros.model import transfer
from rsea_ros.model.equations import gear_inertia, train_ratio
from rsea_ros.model.rig import END_NAMES, Rig
from rsea_ros.model.train import PARTS, TRAINS, Part, Train
from rsea_ros.paper import formulas
from rsea_ros.records.record import ComplexArray, FloatArray

TOLERANCES = ((3.0, 90.0), (1.0, 90.0), (3.0, 10.0), (1.0, 5.0))
"""dB and degrees; 90 degrees leave the phase out of account."""


@dataclass(frozen=True)
class Bands:
    """Of one actuator. eq_7: Hz, with J_sc. eq_7_spin: Hz, with J_sc + n J_r, of either sign; spin_range: the
    same over 90 % of J_m within its spread. rows: the exact bands, Hz, by what they are of, for TOLERANCES.

    spring_limit: N m at the limit of 5 deg, of the nonlinear Eq. (8). motor_limit: by frequency (Hz), the
    amplitude of T_d, N m, that the motor's torque limit leaves against clamped ends.
    """

    eq_7: float
    eq_7_spin: float
    spin_range: tuple[float, float]
    rows: Mapping[str, tuple[float, ...]]
    spring_limit: float
    motor_limit: Mapping[float, float]


def bands(rig: Rig, motor_torque: float) -> Bands:
    """Return the bands of a rig. motor_torque: N m."""
    k_s, j_sc, b_s = (rig[n] for n in ("spring.stiffness", "chassis.inertia", "spring.damping"))
    functions = {
        "Eq. (6) undamped, element": formulas.eq_6_distal_per_proximal(k_s, j_sc, 0.0),
        "Eq. (6) with b_s, element": formulas.eq_6_distal_per_proximal(k_s, j_sc, b_s),
        "With the rotor's spin, element": transfer.end_to_end(rig, "element"),
        "With the rotor's spin, sensor sees K_s + b_s s": transfer.end_to_end(rig),
    }
    inner, spread = transfer.inner_inertia(rig), rig.spread("rotor.reflected_inertia")
    edge = float(transfer.undamped_band(k_s, inner))
    return Bands(
        eq_7=transfer.pure_torque_bandwidth(k_s, j_sc),
        eq_7_spin=edge,
        spin_range=band_range(k_s, j_sc, inner - j_sc, spread),
        rows={n: tuple(transfer.flat_band(f, *t) for t in TOLERANCES) for n, f in functions.items()},
        spring_limit=0.5 * k_s * math.sin(2.0 * math.radians(5.0)),
        motor_limit={f: motor_torque * _gain(rig, f) for f in (1.0, 5.0, 10.0, edge)},
    )


def _gain(rig: Rig, hz: float) -> float:
    clamped = replace(rig, clamped=frozenset(END_NAMES))
    return float(abs(transfer.end_response(clamped, np.array([hz]))[0]))


HZ: FloatArray = np.geomspace(0.5, 140.0, 60)


@dataclass(frozen=True)
class Arrangement:
    """A train with both ends clamped. ratio: n. outer, inner: kg m^2 of den and of T_p's numerator.

    band: undamped, up to where T_d/T_p is within 3 dB, Hz.
    """

    beside_spring: Part
    train: Train
    ratio: float
    outer: float
    inner: float
    band: float


@dataclass(frozen=True)
class Limit:
    """Something that one model becomes. errors: largest relative difference, 0.5 to 140 Hz, at each value."""

    what: str
    of: str
    values: tuple[float, ...]
    errors: tuple[float, ...]


def arrangements(rig: Rig) -> tuple[Arrangement, ...]:
    """Return the rig's inertias with each train, and with either part beside the spring."""
    turned = [replace(rig, train=t, beside_spring=p) for p in PARTS for t in TRAINS]
    inner = [transfer.inner_inertia(r) for r in turned]
    edges = transfer.undamped_band(rig["spring.stiffness"], np.array(inner))
    outer = [r["chassis.inertia"] + gear_inertia(r) for r in turned]
    return tuple(
        Arrangement(r.beside_spring, r.train, train_ratio(r), *of_train, float(edge))
        for r, of_train, edge in zip(turned, zip(outer, inner, strict=True), edges, strict=True)
    )


def limits(rig: Rig) -> tuple[Limit, ...]:
    """Return the limits in which the models of a rig with a free housing meet."""
    clamped = replace(rig, clamped=frozenset(END_NAMES))
    lumped, star = replace(clamped, train="lumped"), replace(clamped, train="star")
    rows: tuple[tuple[str, str, tuple[float, ...], Callable[[float], float]], ...] = (
        ("Both ends clamped: T_d/T_m lumped is T_d/T_m unlumped", "",
         (1.0,), lambda v: _off(lumped, clamped)),
        ("A heavy load is a clamp: T_d/T_m of the free housing becomes Eq. (4)", "load, kg·m²",
               (1e2, 1e4, 1e6), lambda v: _off(rig.with_values({"housing_end.inertia": v}), clamped)),
        ("A large ratio at the same J_m: T_p/T_m becomes Eq. (5), planetary", "N",
               (5e1, 5e3, 5e5), lambda v: _off_eq_5(clamped.with_values({"gear.ratio": v}))),
        ("A large ratio at the same J_m: T_p/T_m becomes Eq. (5), star", "N",
               (5e1, 5e3, 5e5), lambda v: _off_eq_5(star.with_values({"gear.ratio": v}))),
        ("A large ratio: star and planetary train are one, housing free", "N",
               (5e1, 5e3, 5e5), lambda v: _off(*(replace(rig, train=train).with_values({"gear.ratio": v})
                                                for train in ("star", "planetary")))),
        ("A stiff spring: T_d/T_p becomes 1", "K_s, N·m/rad",
               (1e6, 1e8, 1e10), lambda v: _end_to_end_off(clamped.with_values({"spring.stiffness": v}))),
    )  # fmt: skip
    return tuple(Limit(what, of, values, tuple(map(error, values))) for what, of, values, error in rows)


def _off(rig: Rig, other: Rig) -> float:
    return _worst(transfer.end_response(rig, HZ), transfer.end_response(other, HZ))


def _off_eq_5(rig: Rig) -> float:
    ratio = rig["gear.ratio"]
    rotor = rig["rotor.reflected_inertia"] / ratio**2, rig["rotor.reflected_damping"] / ratio**2
    eq_5 = formulas.eq_5_proximal_per_motor(
        rig["spring.stiffness"], *rotor, ratio, rig["chassis.inertia"], rig["spring.damping"]
    )
    return _worst(transfer.end_response(rig, HZ, "housing_end"), eq_5(2j * np.pi * HZ))


def _end_to_end_off(rig: Rig) -> float:
    both = transfer.end_response(rig, HZ) / transfer.end_response(rig, HZ, "housing_end")
    return _worst(both, np.ones(len(HZ), complex))


def _worst(ours: ComplexArray, expected: ComplexArray) -> float:
    return float(np.max(np.abs(ours / expected - 1.0)))
