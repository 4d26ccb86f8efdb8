"""Laws that no catalogue has, put into the command or the sensors of a calibration record."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from rsea_ros.records.record import FloatArray

RATE = 280.0
"""Hz, of all records."""


@dataclass(frozen=True)
class Law:
    """A law outside the catalogue, in the command before it acts or in the sensors' values.

    on: the plants that show it. known_as: its effect of the catalogue, which then is left out of the search.
    """

    on: tuple[str, ...]
    command: Callable[[FloatArray, float], FloatArray] | None = None
    sensor: Callable | None = None
    known_as: str = ""


def _dead_zone(u: FloatArray, size: float) -> FloatArray:
    width = 3.0 * size
    return np.sign(u) * np.maximum(np.abs(u) - width, 0.0)


def _rate_limit(u: FloatArray, size: float) -> FloatArray:
    step, out = 1500.0 / size / RATE, np.empty_like(u)
    last = 0.0
    for k, wanted in enumerate(u):
        last += min(max(wanted - last, -step), step)
        out[k] = last
    return out


def _fade(u: FloatArray, size: float) -> FloatArray:
    return u * (1.0 - 0.2 * size * np.linspace(0.0, 1.0, len(u)))


def _one_sided(u: FloatArray, size: float) -> FloatArray:
    return np.where(u > 0.0, (1.0 + 0.12 * size) * u, u)


def _overshoot(u: FloatArray, size: float) -> FloatArray:
    from scipy.signal import cont2discrete, lfilter

    w, zeta = 2.0 * np.pi * 40.0, 0.5 / (1.0 + size)
    b, a, _ = cont2discrete(([w * w], [1.0, 2.0 * zeta * w, w * w]), 1.0 / RATE)
    return lfilter(b.ravel(), a, u)


def _sensor(channel: str, error: Callable[..., FloatArray]) -> Callable:
    def apply(measured, size, t, rng):
        y = measured[channel]
        return {**measured, channel: y + size * error(y, t, rng)}

    return apply


def _walk(rng: np.random.Generator, y: FloatArray) -> FloatArray:
    return np.cumsum(rng.normal(size=len(y))) / np.sqrt(RATE)


DRIVEN, WITH_FT = ("open", "sea"), ("open", "sea", "loop")
FT: Mapping[str, tuple[Callable[..., FloatArray], str]] = {
    "quadratic_ft": (lambda y, t, rng: 0.004 * y**2, ""),
    "thermal_ft": (lambda y, t, rng: -np.expm1(-t / (0.2 * t[-1])), "ft_drift"),
    "walking_ft": (lambda y, t, rng: 0.15 * _walk(rng, y), ""),
    "cubic_ft": (lambda y, t, rng: 2.0e-4 * y**3 / (1.0 + 0.01 * y**2), ""),
}
TORQUE: Mapping[str, Callable[..., FloatArray]] = {
    "torque_by_position": lambda y, t, rng: 1.5 * np.sin(2.0 * np.pi * t / 1.7),
    "torque_squared": lambda y, t, rng: 0.01 * y * np.abs(y),
    "torque_walk": lambda y, t, rng: 0.5 * _walk(rng, y),
}
LAWS = {
    "dead_zone": Law(DRIVEN, command=_dead_zone, known_as="dead_zone"),
    "rate_limit": Law(DRIVEN, command=_rate_limit),
    "fade": Law(DRIVEN, command=_fade, known_as="torque_constant_drift"),
    "one_sided_gain": Law(DRIVEN, command=_one_sided),
    "overshoot": Law(DRIVEN, command=_overshoot, known_as="current_loop_overshoot"),
    **{name: Law(WITH_FT, sensor=_sensor("ft", law), known_as=known) for name, (law, known) in FT.items()},
    "eccentric_encoder": Law(
        WITH_FT, sensor=_sensor("position", lambda y, t, rng: 1.0e-4 * np.sin(502.0 * y)),
        known_as="encoder_eccentricity",
    ),
    **{name: Law(("rigid",), sensor=_sensor("motor_torque", law)) for name, law in TORQUE.items()},
}  # fmt: skip
"""Laws outside the catalogue by name."""
