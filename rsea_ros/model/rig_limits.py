"""Limits of a machine that nobody states: the smallest that its rig, motor and sensor give (decision 213)."""

import math
from collections.abc import Mapping

from rsea_ros.errors import ParameterError
from rsea_ros.model.rig import END_NAMES, Rig, motor_torque

SLEW, POWER = 10_000.0, 250.0
"""N m/s, W: limits of a driver whatever the rig."""
UNKNOWN: Mapping[str, float] = {}
FASTEST, FELT, BENT = 5.0, 110.0, math.radians(5.0)
"""Derived limits where rig and hardware state no smaller one: rad/s, half as much again as the paper's motor
turns without load; N m, what the largest sensor of its series (120) measures with some to spare; rad, 5°."""
SHARE = 0.8
"""Of the velocity that the largest torque reaches against the gear's damping: 0.8 of it is a fault."""
REACH = 3.0
"""Times what the largest torque does at rest that a stated limit may be: a step overshoots to twice it, and
stiffness and damping are known to some ten percent; degrees are 57 times radians, mrad 1000."""


def derive(
    stated: Mapping[str, float], rig: Rig, rating: Mapping[str, float] = UNKNOWN
) -> tuple[dict[str, float], dict[str, str]]:
    """Return limits of torque, deflection, velocity and ft, and the source of those that were not stated.

    stated: by name; inf: none. rating: of the hardware, by the same names: N m of the motor, rad/s without
    load, N m of the sensor. Raises ParameterError for one that is beyond what the machine ever reaches.
    """
    motor, stiffness = motor_torque(rig), math.inf if rig.rigid_spring else rig["spring.stiffness"]
    damping = rig["rotor.reflected_damping"]
    stop = min((e.parameters["angle"] for e in rig.effects if e.name == "hard_stop"), default=math.inf)
    rated_torque, rated_velocity, rated_ft = (rating.get(n, math.inf) for n in ("torque", "velocity", "ft"))
    limits: dict[str, float] = {}
    sources: dict[str, str] = {}

    def settle(name: str, *bounds: tuple[float, str]) -> float:
        least = min(bounds)
        limits[name] = stated.get(name, least[0])
        if name not in stated:
            sources[name] = least[1]
        return least[0]

    settle("deflection", (BENT, "5°, where the rig states no stop"), (stop, "hard_stop of the rig"))
    most = settle(
        "torque",
        motor,
        (rated_torque, "the motor's own limit"),
        (stiffness * limits["deflection"], "deflection_limit times the spring's stiffness"),
    )
    most = max(most, stated.get("torque", 0.0))
    settle(
        "velocity",
        (FASTEST, "where gear and motor allow more"),
        (SHARE * most / damping if damping else math.inf,
         f"{SHARE:g} of what {most:.4g} N·m reach against the gear's damping"),
        (rated_velocity, "the motor's speed without load"),
    )  # fmt: skip
    settle("ft", (FELT, "where the sensor states no smaller range"), (rated_ft, "the F/T sensor's range"))
    largest = max(motor[0], stated.get("torque", 0.0))
    for name, unit, bound, whose in (
        ("torque", "N·m", rated_torque * (1.0 + 1e-9), "the motor's own limit"),
        ("ft", "N·m", rated_ft, "the F/T sensor's range"),
        ("velocity", "rad/s", REACH * rated_velocity, f"{REACH:g} times the motor's speed without load"),
        ("velocity", "rad/s", REACH * largest / damping if damping else math.inf,
         f"{REACH:g} times what {largest:.4g} N·m reach against the gear's damping"),
        ("deflection", "rad", REACH * largest / stiffness,
         f"{REACH:g} times what {largest:.4g} N·m deflect the spring"),
    ):  # fmt: skip
        value = stated.get(name, math.inf)
        if math.isfinite(value) and value > bound:
            raise ParameterError(
                f"parameter {name}_limit = {value:g} {unit}, expected at most {bound:.4g} {unit}, {whose}"
            )
    return limits, sources


def derive_rest(
    stated: Mapping[str, float], torque: float, motor: float, velocity: float,
    rating: Mapping[str, float] = UNKNOWN,
) -> tuple[dict[str, float], dict[str, str]]:  # fmt: skip
    """Return limits of effort, error, current, voltage and power, and the source of those not stated.

    stated: by name; inf: none. torque, velocity: their limits. motor: what the motor makes at most, N m.
    rating: its current, A, lowest and highest voltage. Raises ParameterError for one beyond what it ever
    reaches: it was written in another unit (decision 333).
    """
    lowest, current = rating.get("lowest", 0.0), rating.get("current", math.inf)
    supply, own = 0.8 * lowest + 0.2 * rating.get("highest", math.inf), "times the motor's own limit"
    limits, sources = {}, {}
    for name, unit, (usual, source), least, most, why in (
        ("effort", "N·m", min((6.0, "any motor"), (0.5 * torque, "half of torque_limit")),
         0.0, 0.5 * motor, "half of what the motor makes"),
        ("error", "N·m", min((15.0, "any motor"), (torque, "torque_limit")),
         0.0, max(torque, 15.0), "torque_limit"),
        ("current", "A", min((12.0, "any motor"), (1.2 * current, f"1.2 {own}")),
         0.0, REACH * current, f"{REACH:g} {own}"),
        ("voltage", "V", min((20.0, "any motor"), (supply, "a fifth above the motor's lowest")),
         lowest / REACH, math.inf, f"the motor's lowest by {REACH:g}"),
        ("power", "W", (POWER, "any motor"), 0.0, max(POWER, REACH * motor * velocity),
         f"{REACH:g} times what the motor makes at velocity_limit"),
    ):  # fmt: skip
        value = limits[name] = stated.get(name, usual)
        if name not in stated:
            sources[name] = source
        elif math.isfinite(value) and not least <= value <= most:
            bound = f"at least {least:.4g}" if value < least else f"at most {most:.4g}"
            told = f"parameter {name}_limit = {value:g} {unit}, expected {bound} {unit}, {why}"
            raise ParameterError(told)
    return limits, sources


def felt_through_spring(limits: dict[str, float], sources: dict[str, str], rig: Rig) -> None:
    """Let ft limit the spring where the drive's angle is not the spring's, as with a free end."""
    if (bent := limits["deflection"] * rig["spring.stiffness"]) < limits["ft"]:
        limits["ft"] = bent
        sources["ft"] = f"deflection_limit {limits['deflection']:.4g} rad times the spring's stiffness"
    limits["deflection"], sources["deflection"] = math.inf, "ft_limit limits it"


def check_travel(position_limit: float, rig: Rig) -> None:
    """Raise ParameterError for a rig with a free end whose position (rad) nothing limits."""
    end = next((end for end in END_NAMES if rig.end_is_free(end)), "")
    if end and math.isinf(position_limit):
        raise ParameterError(
            f"parameter position_limit = 0 rad (none), expected one: {end} of rig {rig.name} is free"
            " to turn (or allow_no_position_limit = true)"
        )
