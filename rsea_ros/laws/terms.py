"""The terms of laws: physical forms over a machine's signals, each written once.

An expression is used twice: over arrays, to see how much it explains, and as text in the generated
file. In it: w speed, q angle, h angle of the load, theta rotor angle, d deflection, T load, u command, t time
(all SI), share of the record's length, m what a memory holds, a the shape, such as a width.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Literal, cast

import numpy as np

from rsea_ros.identification.missing_torque import Place
from rsea_ros.records.record import FloatArray

Memory = Literal["", "lag", "delay", "dahl", "play", "heat", "ring"]
_ARRAYS = {
    "abs": np.abs, "sin": np.sin, "cos": np.cos, "tanh": np.tanh, "exp": np.exp, "sign": np.sign,
    "min": np.minimum, "max": np.maximum, "pi": math.pi,
}  # fmt: skip


@dataclass(frozen=True)
class Term:
    """One term of a law: coefficient times an expression.

    regressor: its variable, for people. unit: of the coefficient. over: the variable whose size sets
    the shape's; shapes: shapes that are tried, as shares of that size, or as they are where over is empty.
    memory: makes m of `over` with the shape. is_drag: takes energy when its coefficient is positive.
    constant: damping ratio of a memory that rings.
    friction: the expression is a size to which the sign of the speed is added, smooth below a creep.
    """

    name: str
    place: Place
    regressor: str
    expression: str
    equation: str
    unit: str
    shape: str = ""
    shape_unit: str = ""
    over: str = ""
    shapes: tuple[float, ...] = ()
    memory: Memory = ""
    is_drag: bool = False
    friction: bool = False
    constant: float = 0.0

    @property
    def remembers(self) -> str:
        """The variable of which its memory is made."""
        at = {"ft": "T", "spring": "d"}.get(self.place, "u")
        return at if self.memory in ("lag", "delay", "heat", "ring") else self.over

    def values(self, variables: Mapping[str, FloatArray], shape: float) -> FloatArray:
        """Return the term over arrays, for a coefficient of 1. variables: by their letters, m included."""
        namespace = {**_ARRAYS, **variables, "a": shape}
        values = eval(_compiled(self.expression, "<term>", "eval"), {"__builtins__": {}}, namespace)
        values = values * np.tanh(variables["w"] / CREEP) * -1.0 if self.friction else values
        return np.broadcast_to(np.asarray(values, np.float64), variables["w"].shape)


CREEP = 2e-3
"""rad/s. Below it a gear with friction creeps (effects/_friction.py)."""


_compiled = cache(compile)


_WIDE = (0.1, 0.2, 0.35, 0.5, 0.7, 0.85)
_NARROW = (0.03, 0.07, 0.15, 0.3)
_SLOW = (2.0, 6.0, 20.0, 60.0)
_FAST = (0.001, 0.002, 0.004, 0.008, 0.015, 0.03)

GEAR_TERMS = (
    Term("offset", "gear", "a constant", "1.0", "1", "N m"),
    Term("coulomb", "gear", "speed", "1.0", "sign(ω)", "N m", is_drag=True, friction=True),
    Term("stribeck", "gear", "speed", "exp(-(w / a) * (w / a))", "exp(-(ω/{a})²)·sign(ω)", "N m",
         "stribeck_velocity", "rad/s", "w", _NARROW, is_drag=True, friction=True),
    Term("saturating_drag", "gear", "speed", "-tanh(w / a)", "-tanh(ω/{a})", "N m", "drag_width", "rad/s",
         "w", (0.07, 0.15, 0.3, 0.6), is_drag=True),
    Term("viscous_difference", "gear", "speed", "-abs(w)", "-|ω|", "N m s/rad"),
    Term("quadratic_drag", "gear", "speed", "-w * abs(w)", "-ω·|ω|", "N m s^2/rad^2", is_drag=True),
    Term("even_drag", "gear", "speed", "-w * w", "-ω²", "N m s^2/rad^2"),
    Term("forward_drag", "gear", "speed", "-max(w, 0.0) * w", "-ω·max(ω, 0)", "N m s^2/rad^2", is_drag=True),
    Term("backward_drag", "gear", "speed", "-min(w, 0.0) * abs(w)", "-|ω|·min(ω, 0)", "N m s^2/rad^2",
         is_drag=True),
    Term("cubic_drag", "gear", "speed", "-w * w * w", "-ω³", "N m s^3/rad^3", is_drag=True),
    Term("load_friction", "gear", "speed and load", "abs(T)", "|T_s|·sign(ω)", "1", is_drag=True,
         friction=True),
    Term("load_drag", "gear", "speed and load", "-abs(T) * w", "-|T_s|·ω", "s/rad", is_drag=True),
    Term("command_friction", "gear", "speed and command", "abs(u)", "|T_m|·sign(ω)", "1", is_drag=True,
         friction=True),
    Term("drift_drag", "gear", "speed and time", "-share * w", "-(t/duration)·ω", "N m s/rad"),
    Term("drift_friction", "gear", "speed and time", "share", "(t/duration)·sign(ω)", "N m", friction=True),
    Term("drift", "gear", "time", "share", "t/duration", "N m"),
    Term("spread_friction", "gear", "speed and position", "abs(q)", "|q|·sign(ω)", "N m/rad", friction=True),
    Term("wide_friction", "gear", "speed and position", "q * q", "q²·sign(ω)", "N m/rad^2", friction=True),
    Term("lean", "gear", "position", "q", "q", "N m/rad"),
    Term("weight_at_gear", "gear", "position", "-sin(q)", "-sin(q)", "N m"),
    Term("bow", "gear", "position", "q * q", "q²", "N m/rad^2"),
    Term("cubic_angle", "gear", "position", "q * q * q", "q³", "N m/rad^3"),
    Term("presliding", "gear", "position's past", "-m", "-z(q)", "N m", "bristle_angle", "rad", "q",
         (0.01, 0.03, 0.1, 0.3), memory="dahl", is_drag=True),
)  # fmt: skip


def _command(port: Place) -> tuple[Term, ...]:
    return (
        Term("gain", port, "command", "u", "u", "1"),
        Term("even_command", port, "command", "abs(u)", "|u|", "1"),
        Term("quadratic_command", port, "command", "u * abs(u)", "u·|u|", "1/(N m)"),
        Term("cubic_command", port, "command", "u * u * u", "u³", "1/(N m)^2"),
        Term("excess", port, "command", "u - min(max(u, -a), a)", "(u - clip(u, ±{a}))", "1", "limit", "N m",
             "u", _WIDE),
        Term("soft_limit", port, "command", "u - a * tanh(u / a)", "(u - {a}·tanh(u/{a}))", "1", "knee",
             "N m", "u", (0.35, 0.7, 1.2)),
        Term("zone", port, "command", "min(max(u, -a), a)", "clip(u, ±{a})", "1", "zone_width", "N m", "u",
             (0.03, 0.07, 0.15, 0.25)),
        Term("band", port, "command", "u * max(0.0, min(1.0, 50.0 * (1.0 - abs(u) / a)))",
             "u where |u| < {a}", "1", "band_width", "N m", "u", (0.05, 0.1, 0.2, 0.3)),
        Term("speed_gain", port, "command and speed", "u * abs(w)", "u·|ω|", "s/rad"),
        Term("speed_excess", port, "command and speed", "abs(w) * (u - min(max(u, -a), a))",
             "|ω|·(u - clip(u, ±{a}))", "s/rad", "speed_limit", "N m", "u", (0.3, 0.5, 0.7)),
        Term("fading_gain", port, "command and time", "share * u", "(t/duration)·u", "1"),
        Term("heated_gain", port, "command and temperature", "m * u", "h(u²)·u", "1/(N m)^2",
             "heating_time", "s", "", _SLOW, memory="heat"),
        Term("lagging", port, "command's past", "m - u", "(lag(u) - u)", "1", "time_constant", "s", "", _FAST,
             memory="lag"),
        Term("delayed", port, "command's past", "m - u", "(u(t - {a}) - u)", "1", "delay", "s", "", _FAST,
             memory="delay"),
    )  # fmt: skip

SPRING_TERMS = (
    Term("lopsided", "spring", "deflection", "d * d", "d²", "N m/rad^2"),
    Term("even_spring", "spring", "deflection", "abs(d)", "|d|", "N m/rad"),
    Term("quadratic_spring", "spring", "deflection", "d * abs(d)", "d·|d|", "N m/rad^2"),
    Term("cubic_spring", "spring", "deflection", "d * d * d", "d³", "N m/rad^3"),
    Term("quintic_spring", "spring", "deflection", "d * d * d * d * d", "d⁵", "N m/rad^5"),
    Term("stop", "spring", "deflection", "d - min(max(d, -a), a)", "(d - clip(d, ±{a}))", "N m/rad",
         "stop_angle", "rad", "d", (0.3, 0.45, 0.6, 0.75, 0.9)),
    Term("slack", "spring", "deflection", "min(max(d, -a), a)", "clip(d, ±{a})", "N m/rad", "slack_angle",
         "rad", "d", (0.03, 0.07, 0.15, 0.25)),
    Term("fading_spring", "spring", "deflection and time", "share * d", "(t/duration)·d", "N m/rad"),
    Term("hysteresis", "spring", "deflection's past", "m", "z(d)", "N m", "hysteresis_angle", "rad", "d",
         (0.03, 0.1, 0.2, 0.4), memory="dahl"),
    Term("play", "spring", "deflection's past", "m", "play(d, {a})", "N m/rad", "play_angle", "rad", "d",
         (0.03, 0.1, 0.2, 0.4), memory="play"),
)  # fmt: skip

SENSOR_TERMS = (
    Term("ft_bias", "ft", "a constant, at the sensor", "1.0", "1", "N m"),
    Term("ft_gain", "ft", "the sensor's torque", "T", "T", "1"),
    Term("ft_even", "ft", "the sensor's torque", "abs(T)", "|T|", "1"),
    Term("ft_quadratic", "ft", "the sensor's torque", "T * T", "T²", "1/(N m)"),
    Term("ft_cubic", "ft", "the sensor's torque", "T * T * T", "T³", "1/(N m)^2"),
    Term("ft_drift", "ft", "time, at the sensor", "share", "t/duration", "N m"),
    Term("ft_settling", "ft", "time, at the sensor", "1.0 - exp(-t / a)", "(1 - exp(-t/{a}))", "N m",
         "settling_time", "s", "", (1.0, 3.0, 8.0, 20.0)),
    Term("ft_fading", "ft", "the sensor's torque and time", "share * T", "(t/duration)·T", "1"),
    Term("ft_lag", "ft", "the sensor's past", "m - T", "(lag(T) - T)", "1", "ft_time_constant", "s", "",
         _FAST, memory="lag"),
)  # fmt: skip
MOTOR_TERMS, COMMAND_TERMS = _command("motor"), _command("command")
LOAD_TERMS = (
    Term("weight", "load", "the load's angle", "-sin(h)", "-sin(φ)", "N m"),
    Term("tilt", "load", "the load's angle", "-cos(h)", "-cos(φ)", "N m"),
    Term("load_lean", "load", "the load's angle", "-h", "-φ", "N m/rad"),
)
ENCODER_TERMS = (
    Term("angle_by_load", "encoder", "the load, at the encoder", "T", "T_s", "rad/(N m)"),
    Term("angle_by_side", "encoder", "the load, at the encoder", "tanh(T / a)", "tanh(T_s/{a})", "rad",
         "load_width", "N m", "T", (0.02, 0.1, 0.3)),
)  # fmt: skip


def wave_terms(cycles: float) -> tuple[Term, ...]:
    """Return terms that repeat with the rotor's angle, so often a turn: torque, encoder error."""
    return (
        *waves("", "gear", "position, periodic", "N m", cycles),
        *waves("angle_", "encoder", "position, periodic, at the encoder", "rad", cycles),
    )


def waves(
    prefix: str, place: Place, regressor: str, unit: str, cycles: float, factor: str = ""
) -> tuple[Term, ...]:
    """Return a sine and a cosine of the rotor's angle, times a factor, so often a turn."""
    shape = ("cycles_per_revolution", "1", "", (cycles,))
    return tuple(
        Term(f"{prefix}{name}", place, regressor, f"{factor} * {f}(a * theta)".removeprefix(" * "),
             f"{factor}·{f}({{a}}·θ)".removeprefix("·"), unit, *shape)
        for name, f in (("sine", "sin"), ("cosine", "cos"))
    )  # fmt: skip


def hum_terms(frequency: float) -> tuple[Term, ...]:
    """Return a sine and a cosine of time in the F/T sensor. frequency: Hz."""
    return tuple(
        Term(f"hum_{name}", "ft", "time, periodic, at the sensor", f"{f}(2.0 * pi * a * t)",
             f"{f}(2π·{{a}}·t)", "N m", "frequency", "Hz", "", (frequency,))
        for name, f in (("sine", "sin"), ("cosine", "cos"))
    )  # fmt: skip


def mode_terms(frequencies: Sequence[float]) -> Iterator[Term]:
    """Return terms of a mode that the load or the deflection shakes, and of a drive that overshoots."""
    for name, zeta, tried in (
        *((f"mode_{round(100 * z)}", z, tuple(frequencies)) for z in (0.02, 0.05, 0.12)),
        *((f"overshoot_{round(100 * z)}", z, (12.0, 20.0, 32.0, 50.0, 80.0)) for z in (0.2, 0.4, 0.7)),
    ):
        slow = name.startswith("mode")
        for place, letter, regressor, unit in (
            ("ft", "T", "the sensor's past", "1"), ("spring", "d", "deflection's past", "N m/rad"),
            ("command", "u", "command's past", "1"), ("motor", "u", "command's past", "1"),
        ):  # fmt: skip
            if tried and slow == (place in ("ft", "spring")):
                yield Term(f"{name}_percent", cast(Place, place), regressor, f"m - {letter}",
                           f"(mode({letter}, {{a}}, ζ = {zeta:g}) - {letter})", unit, "mode_frequency", "Hz",
                           "", tried, memory="ring", constant=zeta)  # fmt: skip
