"""The margins of a design with every part within its tolerance: Monte Carlo, percentiles."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from rsea_ros.design import mechanism
from rsea_ros.design.motor_gear_units import MotorGear
from rsea_ros.design.requirement import Requirement
from rsea_ros.design.spring_design import SpringDesign, bisect, least_stiffness, spring_design
from rsea_ros.model.bandwidth import undamped_band
from rsea_ros.records.record import FloatArray

SPREADS: Mapping[str, float] = MappingProxyType(
    {"rate": 0.05, "arm": 0.005, "spring_radius": 0.04, "inertia": 0.05, "motor": 0.05}
)
"""Relative, one sigma. rate: the paper's springs were 9.5 % below the maker's number. The rotor's spread is
the unit's (motor_gear_units.py)."""
SAMPLES = 20_000


@dataclass(frozen=True)
class Margin:
    """A quantity under tolerance: 5th, 50th and 95th percentile, its limit, and the share that meets it."""

    name: str
    unit: str
    percentiles: tuple[float, float, float]
    limit: float
    share: float


def spreads_of(unit: MotorGear) -> dict[str, float]:
    """Return every spread of a design with this unit."""
    return {**SPREADS, "rotor": unit.rotor_spread}


def margins(
    design: SpringDesign, spreads: Mapping[str, float] | None = None, seed: int = 0
) -> tuple[Margin, ...]:
    """Return the margins of a design, and last the share in which every demand is met at once.

    spreads: by part, relative, one sigma; those of the design's unit where left out.
    """
    if spreads is None:
        spreads = spreads_of(design.unit)
    r, draw = design.requirement, _draws(spreads, seed)
    arm, radius = r.arm * draw["arm"], r.spring_radius * draw["spring_radius"]
    k_s = 2.0 * design.rate * draw["rate"] * (arm**2 + radius**2 / 3.0)
    inertia = r.inertia * draw["inertia"]
    inner = inertia + design.unit.spin * draw["rotor"]
    theta, limit = np.degrees(mechanism.deflection(k_s, r.torque)), float(np.degrees(r.deflection))
    demands = [
        ("Bandwidth by Eq. (7)", "Hz", undamped_band(k_s, inertia), r.bandwidth, True),
        ("Bandwidth with the rotor's spin", "Hz", undamped_band(k_s, inner), r.bandwidth, True),
        ("Torque that the mechanism carries", "N m", mechanism.largest_torque(k_s), r.torque, True),
        ("Deflection", "deg", np.where(np.isnan(theta), np.inf, theta), limit, False),
        ("Peak torque of motor and gear", "N m", design.unit.strongest * draw["motor"], r.torque, True),
    ]  # fmt: skip
    met = [values >= limit if least else values <= limit for _, _, values, limit, least in demands]
    rows = [
        Margin(name, unit, _percentiles(values), limit, float(ok.mean()))
        for (name, unit, values, limit, _), ok in zip(demands, met, strict=True)
    ]
    together = float(np.logical_and.reduce(met).mean())
    return (*rows, Margin("All at once", "", (np.nan, np.nan, np.nan), np.nan, together))


def robust_stiffness(requirement: Requirement, unit: MotorGear) -> float:
    """Return the least K_s, N m/rad, with which 95 % of all parts within tolerance meets every demand.

    inf where the motor alone fails more often. Bisection in log K_s.
    """

    def reaches(k_s: float) -> bool:
        return margins(spring_design(requirement, unit, k_s))[-1].share >= 0.95

    low = least_stiffness(requirement, unit)
    return bisect(reaches, low, 100.0 * low, 12) if reaches(100.0 * low) else float("inf")


def _draws(spreads: Mapping[str, float], seed: int) -> dict[str, FloatArray]:
    """Return log-normal factors by part, shape (SAMPLES,)."""
    rng = np.random.default_rng(seed)
    return {name: np.exp(spread * rng.standard_normal(SAMPLES)) for name, spread in spreads.items()}


def _percentiles(values: FloatArray) -> tuple[float, float, float]:
    low, middle, high = np.percentile(values, (5.0, 50.0, 95.0), method="nearest")
    return float(low), float(middle), float(high)
