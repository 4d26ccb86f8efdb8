"""Up to which frequency and amplitude an actuator is a pure torque source: Eq. (7) and the exact bands."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from control import TransferFunction

from rsea_ros.design.spring_design import band_range
from rsea_ros.model import outputs
from rsea_ros.model.bandwidth import (
    end_to_end,
    flat_band,
    inner_inertia,
    pure_torque_bandwidth,
    undamped_band,
)
from rsea_ros.model.rig import END_NAMES, Rig
from rsea_ros.model.transfer import frequency_response
from rsea_ros.paper.formulas import eq_6_distal_per_proximal

TOLERANCES = ((3.0, 90.0), (1.0, 90.0), (3.0, 10.0), (1.0, 5.0))
"""dB and degrees; 90 degrees leave the phase out of account."""


@dataclass(frozen=True)
class BandRow:
    """hz: by tolerance of TOLERANCES."""

    what: str
    hz: tuple[float, ...]


@dataclass(frozen=True)
class Bands:
    """Of one actuator. eq_7: Hz, with J_sc. eq_7_spin: Hz, with J_sc + n J_r, of either sign; spin_range: the
    same over 90 % of J_m within its spread.

    spring_limit: N m at the deflection limit, of the nonlinear Eq. (8). motor_limit: by frequency (Hz), the
    amplitude of T_d, N m, that the motor's torque limit leaves against clamped ends.
    """

    eq_7: float
    eq_7_spin: float
    spin_range: tuple[float, float]
    rows: tuple[BandRow, ...]
    spring_limit: float
    motor_limit: Mapping[float, float]


def bands(rig: Rig, motor_torque: float, deflection: float = math.radians(5.0)) -> Bands:
    """Return the bands of a rig. motor_torque: N m. deflection: rad."""
    k_s, j_sc, b_s = (rig[n] for n in ("spring.stiffness", "chassis.inertia", "spring.damping"))
    functions = {
        "Eq. (6) undamped, element": eq_6_distal_per_proximal(k_s, j_sc, 0.0),
        "Eq. (6) with b_s, element": eq_6_distal_per_proximal(k_s, j_sc, b_s),
        "With the rotor's spin, element": end_to_end(rig, "element"),
        "With the rotor's spin, sensor sees K_s + b_s s": end_to_end(rig),
    }
    inner, spread = inner_inertia(rig), rig.spread("rotor.reflected_inertia")
    edge = float(undamped_band(k_s, inner))
    return Bands(
        eq_7=pure_torque_bandwidth(k_s, j_sc),
        eq_7_spin=edge,
        spin_range=band_range(k_s, j_sc, inner - j_sc, spread),
        rows=tuple(BandRow(what, _edges(function)) for what, function in functions.items()),
        spring_limit=0.5 * k_s * math.sin(2.0 * deflection),
        motor_limit={f: motor_torque * _gain(rig, f) for f in (1.0, 5.0, 10.0, edge)},
    )


def _edges(function: TransferFunction) -> tuple[float, ...]:
    return tuple(flat_band(function, db, deg) for db, deg in TOLERANCES)


def _gain(rig: Rig, hz: float) -> float:
    clamped = replace(rig, clamped=frozenset(END_NAMES))
    return float(
        abs(frequency_response(clamped, outputs.end_torque(clamped, "spring_end"), np.array([hz]))[0])
    )
