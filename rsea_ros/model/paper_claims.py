"""What the paper prints as numbers, each beside the same number recomputed here.

A claim keeps the text as printed, so that agreement means: equal to the last printed digit.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType

from rsea_ros.model import paper_formulas as paper
from rsea_ros.model.bandwidth import flat_band

TABLE_2: Mapping[str, tuple[str, str]] = MappingProxyType(
    {
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
)
"""Table 2 as printed (the paper leaves the per-radian out of its units)."""

SPRING_RATE, ARM = 207350.0, 0.0635
"""N/m of one spring, nominal, and half of the 127 mm between two (section 3.2.1)."""
NO_LOAD_CURRENT, NO_LOAD_SPEED, TORQUE_CONSTANT = 1.65, 33.1 * 2.0 * math.pi / 60.0, 6.826
"""A, rad/s and N m/A of the motor without load (maker's data): what all drag together can be."""
PENDULUM_MASS, PENDULUM_LENGTH, GRAVITY = 5.8, 0.114, 9.80665
PROTOTYPE_RATE, PROTOTYPE_ARM = 185185.0, 0.0254
PROTOTYPE_STIFFNESS, PROTOTYPE_INERTIA = 260.0, 6.169e-4
KNEE_TORQUE = 150.0


@dataclass(frozen=True)
class Claim:
    """where: section or equation. printed: the paper's digits. ours: same unit. how: what ours comes from."""

    where: str
    what: str
    printed: str
    ours: float
    unit: str
    how: str

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


def claims() -> tuple[Claim, ...]:
    """Return every number of the paper that can be recomputed from others of it."""
    return (
        *_from_the_fit(),
        *_from_the_parts(),
        *_from_the_springs(),
        *_from_the_bandwidth(),
        *_from_the_prototype(),
    )


def _from_the_fit() -> Iterator[Claim]:
    j_eff, b_eff = paper.eq_10_inertia_and_damping(table_2("K_s"))
    c_0, _, c_2 = paper.EQ_10
    yield Claim(
        "Eq. (10)", "K_s/J_eff of the numerator", "1560.436", c_2, "1/s^2", "K_s/J_eff of the denominator"
    )
    yield Claim("Eq. (10)", "gain at rest, as Eq. (4) has it", "1.000", c_0 / c_2, "1", "1560.436 / 1638.783")
    yield Claim("Table 2", "J_m + J_sc", "0.957", j_eff, "kg m^2", "Eq. (10): K_s / mean of both K_s/J_eff")
    yield Claim("Table 2", "b_m + b_s", "26.088", b_eff, "N m s/rad", "Eq. (10): 27.267 J_eff")
    j_m, b_m = j_eff - table_2("J_sc"), b_eff - table_2("b_s")
    yield Claim(
        "Table 2", "J_m", TABLE_2["J_m"][0], j_m, "kg m^2", "Eq. (10), both K_s/J_eff averaged, less J_sc"
    )
    yield Claim("Table 2", "b_m", TABLE_2["b_m"][0], b_m, "N m s/rad", "Eq. (10), less b_s")


def _from_the_parts() -> Iterator[Claim]:
    inertia = PENDULUM_MASS * PENDULUM_LENGTH**2
    stiffness = PENDULUM_MASS * GRAVITY * PENDULUM_LENGTH
    yield Claim(
        "Table 2",
        "J_ld, pendulum",
        TABLE_2["J_ld"][0],
        inertia,
        "kg m^2",
        "m l² of 5.8 kg at 0.114 m, at least",
    )
    yield Claim(
        "Table 2", "K_ld, pendulum", TABLE_2["K_ld"][0], stiffness, "N m/rad", "m g l of 5.8 kg at 0.114 m"
    )
    drag = TORQUE_CONSTANT * NO_LOAD_CURRENT / NO_LOAD_SPEED
    yield Claim(
        "Table 2",
        "b_m, viscous",
        TABLE_2["b_m"][0],
        drag,
        "N m s/rad",
        "at most: no-load current 1.65 A at 33.1 rpm",
    )


def _from_the_springs() -> Iterator[Claim]:
    for where, what, printed, inches in (
        ("3.2.1", "separation, platform", "127", 5.0),
        ("3.2.2", "link of the pendulum", "114", 4.5),
        ("4.1", "separation, prototype", "50.8", 2.0),
    ):
        yield Claim(where, what, printed, 25.4 * inches, "mm", f"{inches:g} in")
    nominal = paper.eq_9_spring_stiffness(SPRING_RATE, ARM, 0.0)
    yield Claim(
        "3.2.1", "K_s, nominal", "1690.5", nominal, "N m/rad", "Eq. (9) with r_s = 0, which is not printed"
    )
    yield Claim(
        "Table 2", "K_s, measured", TABLE_2["K_s"][0], 1690.5, "N m/rad", "nominal K_s of section 3.2.1"
    )
    ours = paper.eq_9_spring_stiffness(PROTOTYPE_RATE, PROTOTYPE_ARM, 0.0)
    yield Claim("4.1", "K_s, prototype", "260", ours, "N m/rad", "Eq. (9) with r_s = 0, which is not printed")


def _from_the_bandwidth() -> Iterator[Claim]:
    yield Claim(
        "Eq. (7)", "factor", "0.292", 1.0 - 10.0 ** (-3.0 / 20.0), "1", "+3 dB to the letter, undamped"
    )
    yield Claim("Eq. (7)", "factor", "0.292", paper.EXACT_FACTOR, "1", "+3.01 dB, a factor √2, undamped")


def _from_the_prototype() -> Iterator[Claim]:
    k_s, j_sc, where = PROTOTYPE_STIFFNESS, PROTOTYPE_INERTIA, "4.1, Fig. 20"
    undamped = paper.eq_6_distal_per_proximal(k_s, j_sc, 0.0)
    what = "bandwidth of the prototype"
    yield Claim(where, what, "55.5", paper.eq_7_bandwidth(k_s, j_sc), "Hz", "Eq. (7)")
    yield Claim(where, what, "55.5", flat_band(undamped), "Hz", "Eq. (6) undamped, +3 dB")
    yield Claim("4.1", "torque the spring carries", "150", k_s / 2.0, "N m", "Eq. (8) at 45°: K_s/2")
    radians = KNEE_TORQUE / k_s
    yield Claim(
        "3.1.2",
        "largest deflection",
        "5",
        math.degrees(radians),
        "deg",
        "150 N·m / 260 N·m/rad, as if linear",
    )
