"""The paper's formulas as printed, Eqs. (1) to (10), and the numbers that it prints beside ours.

Eq. (7) is in `model/transfer.py`: the design method needs it too. The model in `model/equations.py` is exact.
k_s: N m/rad; j_*: kg m^2; b_*: N m s/rad, at the gear output, but for `*_rotor`, which are at the rotor
(times N^2 at the output). The term that Eqs. (5) to (7) leave out is in docs/physics.md.

A claim keeps the text as printed, so that agreement means: equal to the last printed digit. Only numbers that
follow from others of the paper count (`found`); the rest need one that it does not print (`silent`), or one
that it says it tuned or that our sources only bound (`unclear`).
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from rsea_ros.documents.units import STANDARD_GRAVITY
from rsea_ros.model.train import Train
from rsea_ros.model.transfer import Fraction, pure_torque_bandwidth


def _over(numerator: list[float], denominator: list[float]) -> Fraction:
    return Fraction(np.array(numerator), np.array(denominator))


def eq_1_lumped_distal_per_motor(k_s: float, j_eff: float, b_eff: float) -> Fraction:
    """Return T_d / T_m = K_s / (J_eff s^2 + b_eff s + K_s), lumped. Paper, Eq. (1)."""
    return _over([k_s], [j_eff, b_eff, k_s])


def eq_5_proximal_per_motor(
    k_s: float, j_rotor: float, b_rotor: float, ratio: float, j_sc: float, b_s: float
) -> Fraction:
    """Return T_p / T_m = (J_sc s^2 + b_s s + K_s) / (denominator of Eq. (4)). Paper, Eq. (5)."""
    return _over([j_sc, b_s, k_s], [j_rotor * ratio**2 + j_sc, b_rotor * ratio**2 + b_s, k_s])


def eq_6_distal_per_proximal(k_s: float, j_sc: float, b_s: float) -> Fraction:
    """Return T_d / T_p = K_s / (J_sc s^2 + b_s s + K_s). Paper, Eq. (6)."""
    return _over([k_s], [j_sc, b_s, k_s])


def eq_8_spring_torque(k: float, radius: float, spring_radius: float, theta: float) -> float:
    """Return T = 2 K (R^2 + r_s^2 / 3) sin(theta) cos(theta), N m. Paper, Eq. (8).

    k: N/m, of one linear spring. radius: moment arm R, m. spring_radius: r_s, m. theta: rad.
    """
    return 2.0 * k * (radius**2 + spring_radius**2 / 3.0) * math.sin(theta) * math.cos(theta)


def eq_9_spring_stiffness(k: float, radius: float, spring_radius: float, theta: float = 0.0) -> float:
    """Return K_s = 2 K (R^2 + r_s^2 / 3) (2 cos^2(theta) - 1), N m/rad, slope of Eq. (8). Paper, Eq. (9)."""
    return 2.0 * k * (radius**2 + spring_radius**2 / 3.0) * (2.0 * math.cos(theta) ** 2 - 1.0)


EQ_10 = (1560.436, 27.267, 1638.783)
"""Fit to the high-impedance test: c_0 / (s^2 + c_1 s + c_2). Paper, Eq. (10)."""


def eq_10_inertia_and_damping(k_s: float) -> tuple[float, float]:
    """Return J_eff (kg m^2) and b_eff (N m s/rad) as the paper has them: both K_s / J_eff averaged.

    That hides a gain of c_0 / c_2 = 0.952 at rest, which a torque constant or friction makes.
    """
    c_0, c_1, c_2 = EQ_10
    j_eff = k_s / (0.5 * (c_0 + c_2))
    return j_eff, c_1 * j_eff


TABLE_2: Mapping[str, tuple[str, str]] = {
    "J_op": ("0.0012", "kg m^2"),
    "J_od": ("0.010", "kg m^2"),
    "J_lp": ("1e8", "kg m^2"),
    "J_ld": ("0.091", "kg m^2"),
    "J_m": ("0.953", "kg m^2"),
    "J_sc": ("0.0040", "kg m^2"),
    "b_s": ("3", "N m s/rad"),
    "b_m": ("23.088", "N m s/rad"),
    "b_lp": ("1e8", "N m s/rad"),
    "b_ld": ("0.02", "N m s/rad"),
    "K_lp": ("1e8", "N m/rad"),
    "K_ld": ("7", "N m/rad"),
    "K_s": ("1530.456", "N m/rad"),
}
"""Table 2 as printed (the paper leaves the per-radian out of its units)."""

SPRING_RATE, ARM = 207350.0, 0.0635
"""N/m of one spring, nominal, and half of the 127 mm between two (section 3.2.1)."""
NO_LOAD_CURRENT, NO_LOAD_SPEED, TORQUE_CONSTANT = 1.65, 33.1 * 2.0 * math.pi / 60.0, 6.826
"""A, rad/s and N m/A of the motor without load (maker's data): what all drag together can be."""
PENDULUM_MASS, PENDULUM_LENGTH = 5.8, 0.114
PROTOTYPE_RATE, PROTOTYPE_ARM = 185185.0, 0.0254
PROTOTYPE_STIFFNESS, PROTOTYPE_INERTIA = 260.0, 6.169e-4
KNEE_TORQUE = 150.0
PROTOTYPE_TRAINS: tuple[Train, Train] = ("harmonic_circular_spline_held", "harmonic_flexspline_held")
"""CPL-25A-160 is a harmonic drive; the paper leaves out which spline is held, so n = -160 or +161."""

Status = Literal["found", "silent", "unclear"]


@dataclass(frozen=True)
class PaperClaim:
    """where: section or equation. printed: the paper's digits. ours: same unit. how: the derivation of ours.

    status: found, where the paper's numbers alone make ours; silent, where one is missing; unclear otherwise.
    """

    where: str
    what: str
    printed: str
    ours: float
    unit: str
    how: str
    status: Status = "found"

    @property
    def difference(self) -> float:
        """(ours - printed) / printed."""
        return self.ours / float(self.printed) - 1.0

    @property
    def agrees(self) -> bool:
        """Whether ours rounds to the printed digits."""
        return abs(self.ours - float(self.printed)) <= 0.5001 * last_digit(self.printed)


def last_digit(printed: str) -> float:
    """Return the value of one step of the last printed digit: 0.01 for `3.14`, 1e-7 for `6.169e-4`."""
    mantissa, _, exponent = printed.lower().partition("e")
    decimals = len(mantissa.partition(".")[2])
    return float(10.0 ** (int(exponent or 0) - decimals))


def table_2(name: str) -> float:
    """Return a value of Table 2, SI."""
    return float(TABLE_2[name][0])


def claims() -> tuple[PaperClaim, ...]:
    """Return every printed number that others determine, those from the paper's numbers alone first."""
    return (*_recompute(), *_from_the_springs(), *_from_the_parts())


def _recompute() -> Iterator[PaperClaim]:
    c_2 = EQ_10[2]
    yield PaperClaim(
        "Eq. (10)", "K_s/J_eff, numerator", "1560.436", c_2, "1/s^2", "K_s/J_eff of the denominator"
    )
    j_eff, b_eff = eq_10_inertia_and_damping(table_2("K_s"))
    j_m, b_m = j_eff - table_2("J_sc"), b_eff - table_2("b_s")
    averaged = "Eq. (10), both K_s/J_eff averaged as the paper says"
    yield PaperClaim("Table 2", "J_m", TABLE_2["J_m"][0], j_m, "kg m^2", f"{averaged}, less J_sc")
    yield PaperClaim("Table 2", "b_m", TABLE_2["b_m"][0], b_m, "N m s/rad", f"{averaged}, less b_s")
    factor = 1.0 - 10.0 ** (-3.0 / 20.0)
    yield PaperClaim(
        "Eq. (7)", "factor", "0.292", factor, "1", "+3 dB of an undamped Eq. (6); √2 would make 0.293"
    )
    band = pure_torque_bandwidth(PROTOTYPE_STIFFNESS, PROTOTYPE_INERTIA)
    yield PaperClaim("4.1, Fig. 20", "bandwidth of the prototype", "55.5", band, "Hz", "Eq. (7)")


def _from_the_springs() -> Iterator[PaperClaim]:
    missing = "Eq. (9) with r_s = 0: r_s is not printed"
    for where, what, printed, rate, arm in (
        ("3.2.1", "K_s, nominal", "1690.5", SPRING_RATE, ARM),
        ("4.1", "K_s, prototype", "260", PROTOTYPE_RATE, PROTOTYPE_ARM),
    ):
        ours = eq_9_spring_stiffness(rate, arm, 0.0)
        yield PaperClaim(where, what, printed, ours, "N m/rad", missing, "silent")


def _from_the_parts() -> Iterator[PaperClaim]:
    inertia = PENDULUM_MASS * PENDULUM_LENGTH**2
    stiffness = PENDULUM_MASS * STANDARD_GRAVITY * PENDULUM_LENGTH
    drag = TORQUE_CONSTANT * NO_LOAD_CURRENT / NO_LOAD_SPEED
    for what, name, ours, unit, how in (
        ("J_ld, pendulum", "J_ld", inertia, "kg m^2", "at least: m l² of 5.8 kg at 0.114 m"),
        ("K_ld, pendulum", "K_ld", stiffness, "N m/rad", "m g l; the paper says that K_ld was tuned"),
        ("b_m, viscous", "b_m", drag, "N m s/rad", "at most: the maker's no-load 1.65 A at 33.1 rpm"),
    ):
        yield PaperClaim("Table 2", what, TABLE_2[name][0], ours, unit, how, "unclear")


@dataclass(frozen=True)
class PaperFinding:
    """found: two statements that cannot both hold. silent: what is left out. unclear: two readings."""

    status: Status
    where: str
    text: str
