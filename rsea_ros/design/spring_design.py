"""A spring stiffness rated by a requirement, the least that meets it, and the trains side by side.

Margins: Monte Carlo with every part within its tolerance, percentiles.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from rsea_ros.design import mechanism
from rsea_ros.design.mechanism import Requirement, spring_rate
from rsea_ros.design.motor_gear_units import MotorGear
from rsea_ros.errors import ParameterError
from rsea_ros.model import transfer
from rsea_ros.model.rig import END_NAMES, Quantity, Rig
from rsea_ros.records.statistics import Z90

DAMPING_RATIO = 0.025
"""Of spring and chassis, assumed: that of the prototype's rig. The paper states none."""


@dataclass(frozen=True)
class Check:
    """A demand and the design's value. least: the demand is a lower limit, otherwise an upper one."""

    name: str
    value: float
    limit: float
    unit: str
    least: bool = True

    @property
    def met(self) -> bool:
        """Whether the design has it; a value that does not exist (nan) does not."""
        return self.value >= self.limit if self.least else self.value <= self.limit


@dataclass(frozen=True)
class SpringDesign:
    """A spring for a requirement.

    stiffness: N m/rad. rate: N/m of each linear spring. deflection: rad, by Eq. (8) at the required torque,
    nan where it cannot carry it. linear: rad, T / K_s. error: share by which Eq. (8) falls short of linear at
    the deflection limit. inner: J_sc + n J_r, kg m^2. resonance: Hz, of the spring on it; nan where it is not
    above zero, so that T_d / T_p only falls. bands: Hz.
    """

    requirement: Requirement
    unit: MotorGear
    stiffness: float
    rate: float
    deflection: float
    linear: float
    error: float
    inner: float
    resonance: float
    band_eq_7: float
    band_exact: float
    checks: tuple[Check, ...]

    @property
    def feasible(self) -> bool:
        """Whether every check is met."""
        return all(check.met for check in self.checks)


def spring_design(requirement: Requirement, unit: MotorGear, stiffness: float) -> SpringDesign:
    """Return the design of a stiffness (N m/rad). Raises ParameterError for one of no possible size."""
    mechanism.check_magnitude("stiffness", stiffness, "N m/rad")
    inner = requirement.inertia + unit.spin
    function = transfer.end_to_end(rig_of(requirement, unit, stiffness))
    exact = transfer.flat_band(function, requirement.tolerance_db, requirement.tolerance_deg)
    band = transfer.pure_torque_bandwidth(stiffness, requirement.inertia)
    theta = float(mechanism.deflection(stiffness, requirement.torque))
    return SpringDesign(
        requirement=requirement,
        unit=unit,
        stiffness=stiffness,
        rate=spring_rate(stiffness, requirement.arm, requirement.spring_radius),
        deflection=theta,
        linear=requirement.torque / stiffness,
        error=float(mechanism.linearity_error(requirement.deflection)),
        inner=inner,
        resonance=math.sqrt(stiffness / inner) / (2.0 * math.pi) if inner > 0.0 else math.nan,
        band_eq_7=band,
        band_exact=exact,
        checks=_checks(requirement, unit, stiffness, theta, band, exact),
    )


def _checks(
    r: Requirement, unit: MotorGear, stiffness: float, theta: float, band: float, exact: float
) -> tuple[Check, ...]:
    carries, turns = float(mechanism.largest_torque(stiffness)), math.degrees(theta)
    return (
        Check("Bandwidth by Eq. (7), as the paper has it", band, r.bandwidth, "Hz"),
        Check("Bandwidth with the rotor's spin, exact", exact, r.bandwidth, "Hz"),
        Check("Torque that the mechanism carries, K_s/2", carries, r.torque, "N m"),
        Check("Deflection at that torque, Eq. (8)", turns, math.degrees(r.deflection), "deg", False),
        Check("Peak torque of motor and gear", unit.strongest, r.torque, "N m"),
    )  # fmt: skip


def stiffness_bounds(requirement: Requirement, unit: MotorGear) -> dict[str, float]:
    """Return the least K_s, N m/rad, for each demand."""
    return {
        "Bandwidth by Eq. (7)": float(
            transfer.undamped_stiffness(requirement.bandwidth, requirement.inertia)
        ),
        "Bandwidth with the rotor's spin": least_for_band(requirement, unit),
        "Torque, K_s/2": 2.0 * requirement.torque,
        "Deflection": mechanism.stiffness_for_deflection(requirement.torque, requirement.deflection),
    }


def least_for_band(requirement: Requirement, unit: MotorGear) -> float:
    """Return the least K_s, N m/rad, whose exact band reaches the required one; bisection in log K_s."""

    def reaches(k_s: float) -> bool:
        function = transfer.end_to_end(rig_of(requirement, unit, k_s))
        band = transfer.flat_band(function, requirement.tolerance_db, requirement.tolerance_deg)
        return band >= requirement.bandwidth

    low, high = 1.0, 2.0
    while not reaches(high):
        low, high = high, 2.0 * high
    while reaches(low) and low > _SOFTEST:
        low, high = 0.5 * low, low
    return bisect(reaches, low, high, 24)


def bisect(reaches: Callable[[float], bool], low: float, high: float, rounds: int) -> float:
    """Return the least value between two that reaches something, the lower of which does not, in its log."""
    for _ in range(rounds):
        middle = math.sqrt(low * high)
        low, high = (low, middle) if reaches(middle) else (middle, high)
    return high


def least_stiffness(requirement: Requirement, unit: MotorGear) -> float:
    """Return the least K_s, N m/rad, that meets every demand on the spring.

    Raises ParameterError for a demand that no spring of a possible size meets.
    """
    demand, least = max(stiffness_bounds(requirement, unit).items(), key=lambda item: item[1])
    if least > mechanism.RANGE[1]:
        most = f"expected one that a spring of {mechanism.RANGE[1]:g} N·m/rad meets"
        raise ParameterError(f"demand “{demand}” asks for a spring of {least:.3g} N·m/rad, {most}")
    return least


def rig_of(requirement: Requirement, unit: MotorGear, stiffness: float) -> Rig:
    """Return the actuator as a rig with both ends clamped."""
    damping = 2.0 * DAMPING_RATIO * math.sqrt(stiffness * requirement.inertia)
    values = {
        "rotor.reflected_inertia": unit["reflected_inertia"],
        "rotor.reflected_damping": unit["reflected_damping"],
        "gear.ratio": unit["ratio"],
        "chassis.inertia": requirement.inertia,
        "spring.stiffness": stiffness,
        "spring.damping": damping,
    }
    return Rig(
        name=f"{unit.name}, {stiffness:.0f} N·m/rad",
        quantities={name: Quantity(value) for name, value in values.items()},
        clamped=frozenset(END_NAMES),
        train=unit.train,
        beside_spring=unit.beside_spring,
    )


_SOFTEST = 1e-9
"""N m/rad: softer than any spring."""
_STEPS = 201


@dataclass(frozen=True)
class WithTrain:
    """A design with one train.

    band_range: Hz, exact, over 90 % of the rotor's inertia. for_band, least: the least K_s, N m/rad, for the
    bandwidth and for all demands.
    """

    design: SpringDesign
    band_range: tuple[float, float]
    for_band: float
    least: float


def by_train(requirement: Requirement, unit: MotorGear, stiffness: float) -> tuple[WithTrain, ...]:
    """Return a design of this stiffness, N m/rad, with each train that the unit may have."""
    return tuple(
        WithTrain(
            spring_design(requirement, turned, stiffness),
            band_range(stiffness, requirement.inertia, turned.spin, turned.rotor_spread),
            least_for_band(requirement, turned),
            max(stiffness_bounds(requirement, turned).values()),
        )
        for turned in map(unit.with_train, unit.trains)
    )


def band_range(stiffness: float, chassis: float, spin: float, spread: float) -> tuple[float, float]:
    """Return the least and the greatest undamped ±3 dB band, Hz, over 90 % of a log-normal rotor inertia.

    stiffness: N m/rad. chassis: J_sc, spin: n J_r, kg m^2. spread: of J_m, relative, one sigma. The band is
    without limit where the range holds a J_m whose spin cancels J_sc.
    """
    inner = chassis + spin * np.exp(Z90 * spread * np.linspace(-1.0, 1.0, _STEPS))
    bands = transfer.undamped_band(stiffness, inner)
    cancels = bool(inner.min() < 0.0 < inner.max())
    return float(bands.min()), math.inf if cancels else float(bands.max())


SPREADS = {"rate": 0.05, "arm": 0.005, "spring_radius": 0.04, "inertia": 0.05, "motor": 0.05}
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
    r, rng = design.requirement, np.random.default_rng(seed)
    draw = {name: np.exp(spread * rng.standard_normal(SAMPLES)) for name, spread in spreads.items()}
    arm, radius = r.arm * draw["arm"], r.spring_radius * draw["spring_radius"]
    k_s = 2.0 * design.rate * draw["rate"] * (arm**2 + radius**2 / 3.0)
    inertia = r.inertia * draw["inertia"]
    inner = inertia + design.unit.spin * draw["rotor"]
    theta, limit = np.degrees(mechanism.deflection(k_s, r.torque)), float(np.degrees(r.deflection))
    demands = [
        ("Bandwidth by Eq. (7)", "Hz", transfer.undamped_band(k_s, inertia), r.bandwidth, True),
        ("Bandwidth with the rotor's spin", "Hz", transfer.undamped_band(k_s, inner), r.bandwidth, True),
        ("Torque that the mechanism carries", "N m", mechanism.largest_torque(k_s), r.torque, True),
        ("Deflection", "deg", np.where(np.isnan(theta), np.inf, theta), limit, False),
        ("Peak torque of motor and gear", "N m", design.unit.strongest * draw["motor"], r.torque, True),
    ]  # fmt: skip
    met = [values >= limit if least else values <= limit for _, _, values, limit, least in demands]
    rows = [
        Margin(name, unit, tuple(np.percentile(values, (5.0, 50.0, 95.0), method="nearest").tolist()), limit,
               float(ok.mean()))
        for (name, unit, values, limit, _), ok in zip(demands, met, strict=True)
    ]  # fmt: skip
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


