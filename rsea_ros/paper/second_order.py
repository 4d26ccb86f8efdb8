"""The paper's second-order fit of T_d / T_m, and the values of the actuator from it (Eq. (10)).

    T_d / T_m = c / (s^2 + a1 s + a0)

With both ends clamped c = a0 = K_s / J_eff and a1 = b_eff / J_eff, so only ratios can be had from torque
alone; a measured K_s turns them into J_eff and b_eff. c and a0 differ by the DC gain, which the paper
averages away.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rsea_ros.errors import IdentificationError
from rsea_ros.identification.result import FrequencyResponse
from rsea_ros.records.record import ComplexArray, FloatArray

_ITERATIONS = 60
_CONVERGED = 1e-10


@dataclass(frozen=True)
class SecondOrder:
    """c / (s^2 + a1 s + a0): 1/s^2, 1/s, 1/s^2. covariance: of (c, a1, a0), shape (3, 3)."""

    c: float
    a1: float
    a0: float
    covariance: FloatArray

    @property
    def dc_gain(self) -> float:
        """Return the gain at rest."""
        return self.c / self.a0

    @property
    def natural_frequency(self) -> float:
        """Return the undamped natural frequency, Hz."""
        return math.sqrt(self.a0) / (2.0 * math.pi)

    @property
    def damping_ratio(self) -> float:
        """Return the damping ratio, 1."""
        return self.a1 / (2.0 * math.sqrt(self.a0))

    def response(self, frequency: FloatArray) -> ComplexArray:
        """Return the response at frequencies in Hz, shape (n,)."""
        s = _laplace(frequency)
        response: ComplexArray = self.c / (s**2 + self.a1 * s + self.a0)
        return response


@dataclass(frozen=True)
class EffectiveValues:
    """J_eff, kg m^2, and b_eff, N m s/rad, at the gear output."""

    inertia: float
    damping: float


def fit_second_order(measured: FrequencyResponse, low: float = 0.0, high: float = math.inf) -> SecondOrder:
    """Fit c, a1, a0 to the lines from low to high, Hz, each weighted by its sd.

    A linear fit whose weights are iterated (Sanathanan, Koerner, IEEE TAC 8, 1963) starts Gauss-Newton on
    the error of the response. Raises IdentificationError for fewer than four lines.
    """
    inside = (measured.frequency >= low) & (measured.frequency <= high) & np.isfinite(measured.response)
    if np.count_nonzero(inside) < 4:
        raise IdentificationError(
            f"second-order fit: {np.count_nonzero(inside)} lines from {low:g} to {high:g} Hz, "
            "expected at least 4"
        )
    s, g = _laplace(measured.frequency[inside]), measured.response[inside]
    sd = _weighable(measured.sd[inside], g)
    scale = float(np.median(np.abs(s)))
    s /= scale
    x = _linear_start(s, g, sd)
    for _ in range(_ITERATIONS):
        error, slope = _linearise(x, s, g, sd)
        step = np.linalg.lstsq(slope, error, rcond=None)[0]
        x = x + step
        if np.max(np.abs(step)) < _CONVERGED * np.max(np.abs(x)):
            break
    _, slope = _linearise(x, s, g, sd)
    units = np.array([scale**2, scale, scale**2])
    covariance = np.linalg.inv(slope.T @ slope) * np.outer(units, units)
    c, a1, a0 = (float(v) for v in x * units)
    return SecondOrder(c, a1, a0, covariance)


def effective_values(k_s: float, c: float, a1: float, a0: float) -> EffectiveValues:
    """Return the values by Eq. (10): J_eff = K_s / mean(c, a0), b_eff = a1 J_eff. k_s: measured, N m/rad."""
    inertia = k_s / (0.5 * (c + a0))
    return EffectiveValues(inertia, a1 * inertia)


def _weighable(sd: FloatArray, response: ComplexArray) -> FloatArray:
    """Return sd with a floor, so that no line without noise has all the weight."""
    floor = 1e-6 * float(np.max(np.abs(response)))
    weighable: FloatArray = np.maximum(sd, floor)
    return weighable


def _linear_start(s: ComplexArray, g: ComplexArray, sd: FloatArray) -> FloatArray:
    """Return c, a1, a0 of s^2 g = c - a1 s g - a0 g, weighted by the last denominator."""
    x: FloatArray = np.zeros(3)
    denominator = np.ones(len(s), complex)
    for _ in range(20):
        weight = 1.0 / (np.abs(denominator) * sd)
        columns = np.stack([weight, -s * g * weight, -g * weight], axis=1)
        x = np.linalg.lstsq(_real(columns), _real(s**2 * g * weight), rcond=None)[0].astype(np.float64)
        denominator = s**2 + x[1] * s + x[2]
    return x


def _linearise(
    x: FloatArray, s: ComplexArray, g: ComplexArray, sd: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return weighted error and slope of the response; real and imaginary part share a circular sd."""
    denominator = s**2 + x[1] * s + x[2]
    model, weight = x[0] / denominator, math.sqrt(2.0) / sd
    slope = np.stack([1.0 / denominator, -model * s / denominator, -model / denominator], axis=1)
    return _real((g - model) * weight), _real(slope * weight[:, None])


def _laplace(frequency: FloatArray) -> ComplexArray:
    s: ComplexArray = np.asarray(2j * np.pi * np.asarray(frequency), dtype=np.complex128)
    return s


def _real(values: npt.NDArray[np.inexact]) -> FloatArray:
    return np.concatenate([values.real, values.imag]).astype(np.float64)
