"""The influence of the rotor's sense of rotation on a design: the possible trains of a unit side by side."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rsea_ros.design.motor_gear_units import MotorGear
from rsea_ros.design.requirement import Requirement
from rsea_ros.design.spring_design import least_for_band, least_stiffness, spring_design
from rsea_ros.model.bandwidth import undamped_band
from rsea_ros.model.train import Train
from rsea_ros.records.statistics import Z90

_STEPS = 201


@dataclass(frozen=True)
class WithTrain:
    """A design with one train.

    turns: n. inner: J_sc + n J_r, kg m^2. band: of the stiffness judged, Hz, exact. band_range: the same
    over 90 % of the rotor's inertia. for_band, least: the least K_s, N m/rad, for the bandwidth and for all
    demands.
    """

    train: Train
    turns: float
    inner: float
    band: float
    band_range: tuple[float, float]
    for_band: float
    least: float


def by_train(requirement: Requirement, unit: MotorGear, stiffness: float) -> tuple[WithTrain, ...]:
    """Return a design of this stiffness, N m/rad, with each train that the unit may have."""
    return tuple(_with_train(requirement, unit.with_train(train), stiffness) for train in unit.trains)


def _with_train(r: Requirement, unit: MotorGear, stiffness: float) -> WithTrain:
    design = spring_design(r, unit, stiffness)
    return WithTrain(
        train=unit.train,
        turns=unit.turns,
        inner=design.inner,
        band=design.band_exact,
        band_range=band_range(stiffness, r.inertia, unit.spin, unit.rotor_spread),
        for_band=least_for_band(r, unit),
        least=least_stiffness(r, unit),
    )


def band_range(stiffness: float, chassis: float, spin: float, spread: float) -> tuple[float, float]:
    """Return the least and the greatest undamped ±3 dB band, Hz, over 90 % of a log-normal rotor inertia.

    stiffness: N m/rad. chassis: J_sc, spin: n J_r, kg m^2. spread: of J_m, relative, one sigma. The band is
    without limit where the range holds a J_m whose spin cancels J_sc.
    """
    inner = chassis + spin * np.exp(Z90 * spread * np.linspace(-1.0, 1.0, _STEPS))
    bands = undamped_band(stiffness, inner)
    cancels = bool(inner.min() < 0.0 < inner.max())
    return float(bands.min()), math.inf if cancels else float(bands.max())


def sense_unknown(rows: Sequence[WithTrain]) -> bool:
    """Return whether the trains differ in the sign of the rotor's spin."""
    return len({row.turns > 0.0 for row in rows}) > 1
