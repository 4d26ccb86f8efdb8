"""Known filters of sensors: what a reading passes before it is logged.

In continuous time, exact for a signal that goes straight from step to step (triangle hold: Franklin, Powell,
Workman, Digital Control of Dynamic Systems, 3rd ed., 1998, section 6.3.2):

    one_pole   1 / (T s + 1)           two_poles   w^2 / (s^2 + 2 zeta w s + w^2)

At the sensor's own samples, z^-1 the one before:

    average      (1 + z^-1 + … + z^-(n-1)) / n            exponential   c / (1 - (1 - c) z^-1)
    alpha_beta   (a + (b - a) z^-1) / (1 - (2 - a - b) z^-1 + (1 - a) z^-2)
    kalman       of a constant velocity: the alpha_beta of its steady gains. sigma of the acceleration, held
                 over a sample, is `ratio` times sigma of a sample (Kalata, IEEE Trans. AES 20, 1984):
                 L = ratio T^2,  r = 4 / (4 + L + sqrt(8 L + L^2)),  a = 1 - r^2,  b = 2 (1 - r)^2

All pass a constant unchanged, and begin at rest at their first value.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from rsea_ros.records.record import ComplexArray, FloatArray


class FilterNumber(NamedTuple):
    """A number of a filter: unit, least and largest value, meaning, whether it is a whole number."""

    unit: str
    low: float
    high: float
    meaning: str
    whole: bool = False


KINDS: Mapping[str, Mapping[str, FilterNumber]] = {
    "one_pole": {"time_constant": FilterNumber("s", 1e-6, 10.0, "T of 1 / (T s + 1)")},
    "two_poles": {
        "frequency": FilterNumber("Hz", 0.01, 1e5, "w / (2 pi) of w^2 / (s^2 + 2 zeta w s + w^2)"),
        "damping_ratio": FilterNumber("1", 0.01, 100.0, "zeta"),
    },
    "average": {"samples": FilterNumber("1", 1, 10_000, "number of the last ones", whole=True)},
    "exponential": {"weight": FilterNumber("1", 1e-6, 1.0, "of the newest sample")},
    "alpha_beta": {
        "alpha": FilterNumber("1", 1e-6, 1.0, "part of a surprise that moves the value"),
        "beta": FilterNumber("1", 1e-9, 1.99, "part that moves the change in a sample"),
    },
    "kalman": {
        "ratio": FilterNumber(
            "1/s^2", 1e-6, 1e12, "sigma of the acceleration over that of a sample; constant velocity"
        )
    },
}
CONTINUOUS = ("one_pole", "two_poles")


class Coefficients(NamedTuple):
    """Of y = b(z^-1) / a(z^-1) u, in rising powers of z^-1."""

    b: FloatArray
    a: FloatArray


@dataclass(frozen=True)
class SensorFilter:
    """A kind of KINDS with its numbers, in their order there."""

    kind: str
    numbers: tuple[float, ...]

    @property
    def is_sampled(self) -> bool:
        """Whether it acts at the sensor's samples."""
        return self.kind not in CONTINUOUS

    def response(self, hz: FloatArray, period: float) -> ComplexArray:
        """Return the response at frequencies, Hz, shape (n,). period: of the sensor's samples, s."""
        s = 2j * np.pi * np.asarray(hz, np.float64)
        if self.is_sampled:
            b, a = (np.polyval(part[::-1], np.exp(-period * s)) for part in self.coefficients(period))
        else:
            b, a = (np.polyval(part, s) for part in self._continuous())
        return np.asarray(b / a)

    def coefficients(self, period: float, *, held: bool = False) -> Coefficients:
        """Return it at values a period (s) apart. held: each lasted since the one before."""
        if not self.is_sampled:
            from scipy.signal import cont2discrete  # half a second that a rig without a filter saves

            b, a, _ = cont2discrete(self._continuous(), period, method="zoh" if held else "foh")
            return Coefficients(np.ravel(b)[1:] if held else np.ravel(b), a)
        match self.kind, self.numbers:
            case "average", (samples,):
                return Coefficients(np.full(round(samples), 1.0 / round(samples)), np.ones(1))
            case "exponential", (weight,):
                return Coefficients(np.array([weight]), np.array([1.0, weight - 1.0]))
            case "kalman", (ratio,):
                alpha, beta = steady_gains(ratio * period**2)
            case _:
                alpha, beta = self.numbers
        return Coefficients(np.array([alpha, beta - alpha]), np.array([1.0, alpha + beta - 2.0, 1.0 - alpha]))

    def over(
        self, values: FloatArray, period: float, begins: Sequence[int] = (0,), *, held: bool = False
    ) -> FloatArray:
        """Return values behind it, shape (n,). begins: where it starts anew. Others: as of `coefficients`."""
        parts = zip(begins, [*begins[1:], len(values)], strict=True)
        known = self.coefficients(period, held=held)
        return np.concatenate([Running(known)(values[first:end]) for first, end in parts])

    def _continuous(self) -> tuple[list[float], list[float]]:
        """Return numerator and denominator in s, highest power first."""
        if self.kind == "one_pole":
            return [1.0], [self.numbers[0], 1.0]
        w, zeta = 2.0 * math.pi * self.numbers[0], self.numbers[1]
        return [w * w], [1.0, 2.0 * zeta * w, w * w]


def steady_gains(index: float) -> tuple[float, float]:
    """Return alpha and beta of the steady Kalman filter with a tracking index L (module docstring)."""
    r = 4.0 / (4.0 + index + math.sqrt(8.0 * index + index**2))
    return 1.0 - r * r, 2.0 * (1.0 - r) ** 2


class Running:
    """A filter that remembers, from call to call."""

    def __init__(self, coefficients: Coefficients) -> None:
        self._b, self._a = coefficients
        self._memory: FloatArray | None = None
        self._first = 0.0

    def __call__(self, values: FloatArray) -> FloatArray:
        """Return the next values behind the filter, shape (n,)."""
        from scipy.signal import lfilter

        if not len(values):
            return values
        if self._memory is None:
            self._first, self._memory = float(values[0]), np.zeros(max(len(self._b), len(self._a)) - 1)
        passed, self._memory = lfilter(self._b, self._a, values - self._first, zi=self._memory)
        return np.asarray(passed + self._first)
