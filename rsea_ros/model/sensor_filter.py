"""Known filters of sensors: what a reading passes before it is logged.

In continuous time, exact for a signal that goes straight from step to step (triangle hold: Franklin, Powell,
Workman, Digital Control of Dynamic Systems, 3rd ed., 1998, section 6.3.2):

    one_pole     1 / (T s + 1)         two_poles    w^2 / (s^2 + 2 zeta w s + w^2)

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
from functools import lru_cache

import numpy as np

from rsea_ros.records.record import ComplexArray, FloatArray

KINDS: Mapping[str, Mapping[str, tuple[str, float, float, str]]] = {
    "one_pole": {"time_constant": ("s", 1e-6, 10.0, "T of 1 / (T s + 1)")},
    "two_poles": {
        "frequency": ("Hz", 0.01, 1e5, "w / (2 pi) of w^2 / (s^2 + 2 zeta w s + w^2)"),
        "damping_ratio": ("1", 0.01, 100.0, "zeta"),
    },
    "average": {"samples": ("1", 1.0, 1e4, "number of the last ones, a whole one")},
    "exponential": {"weight": ("1", 1e-6, 1.0, "of the newest sample")},
    "alpha_beta": {
        "alpha": ("1", 1e-6, 1.0, "part of a surprise that moves the value"),
        "beta": ("1", 1e-9, 1.99, "part that moves the change in a sample"),
    },
    "kalman": {"ratio": ("1/s^2", 1e-6, 1e12, "sigma of the acceleration over that of a sample")},
}
"""Numbers of each: unit, least and largest value, meaning."""
_Coefficients = tuple[FloatArray, FloatArray]
"""b and a of y = b(z^-1) / a(z^-1) u, in rising powers of z^-1."""


@dataclass(frozen=True)
class SensorFilter:
    """A kind of KINDS with its numbers, in their order there."""

    kind: str
    numbers: tuple[float, ...]

    @property
    def is_sampled(self) -> bool:
        """Whether it acts at the sensor's samples."""
        return self.kind not in ("one_pole", "two_poles")

    def response(self, hz: FloatArray, period: float) -> ComplexArray:
        """Return the response at frequencies, Hz, shape (n,). period: of the sensor's samples, s."""
        s = 2j * np.pi * np.asarray(hz, np.float64)
        if not self.is_sampled:
            return np.asarray(np.polyval(self._continuous()[0], s) / np.polyval(self._continuous()[1], s))
        b, a = (np.polyval(part[::-1], np.exp(-period * s)) for part in self.coefficients(period))
        return np.asarray(b / a)

    @lru_cache(maxsize=64)  # noqa: B019  a small value, which a fit needs for every simulation
    def coefficients(self, period: float, *, held: bool = False) -> _Coefficients:
        """Return it at values a period (s) apart. held: each lasted since the one before."""
        match self.kind, self.numbers:
            case "average", (samples,):
                return np.full(round(samples), 1.0 / round(samples)), np.ones(1)
            case "exponential", (weight,):
                return np.array([weight]), np.array([1.0, weight - 1.0])
            case "alpha_beta", (alpha, beta):
                pass
            case "kalman", (ratio,):
                index = ratio * period**2
                r = 4.0 / (4.0 + index + math.sqrt(8.0 * index + index**2))
                alpha, beta = 1.0 - r * r, 2.0 * (1.0 - r) ** 2
            case _:
                from scipy.signal import cont2discrete  # half a second that a rig without a filter saves

                b, a, _ = cont2discrete(self._continuous(), period, method="zoh" if held else "foh")
                return np.ravel(b)[int(held) :], a
        return np.array([alpha, beta - alpha]), np.array([1.0, alpha + beta - 2.0, 1.0 - alpha])

    def over(
        self, values: FloatArray, period: float, begins: Sequence[int] = (0,), *, held: bool = False
    ) -> FloatArray:
        """Return values behind it, shape (n,). begins: where it starts anew. Others: as of `coefficients`."""
        parts, known = np.split(values, begins[1:]), self.coefficients(period, held=held)
        return np.concatenate([Running(known)(part) for part in parts])

    def _continuous(self) -> list[list[float]]:
        """Return numerator and denominator in s, highest power first."""
        if self.kind == "one_pole":
            return [[1.0], [self.numbers[0], 1.0]]
        w, zeta = 2.0 * math.pi * self.numbers[0], self.numbers[1]
        return [[w * w], [1.0, 2.0 * zeta * w, w * w]]


class Running:
    """A filter that remembers from call to call. first: value at which it is at rest; nan: the next one."""

    def __init__(self, coefficients: _Coefficients, first: float = math.nan) -> None:
        self._b, self._a = coefficients
        self._memory, self._first = np.zeros(max(len(self._b), len(self._a)) - 1), first

    def __call__(self, values: FloatArray) -> FloatArray:
        """Return the next values behind the filter, shape (n,)."""
        from scipy.signal import lfilter

        if math.isnan(self._first) and len(values):
            self._first = float(values[0])
        passed, self._memory = lfilter(self._b, self._a, values - self._first, zi=self._memory)
        return np.asarray(passed + self._first)
