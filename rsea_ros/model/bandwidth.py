"""Up to where an actuator is a pure torque source: Eq. (7), and the exact band in magnitude and phase."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
from numpy.polynomial import polynomial

from rsea_ros.errors import ParameterError
from rsea_ros.model.outputs import Sees
from rsea_ros.model.rig import END_NAMES, Rig
from rsea_ros.model.train import spin_inertia
from rsea_ros.model.transfer import Fraction, distal_over_proximal, distal_per_proximal
from rsea_ros.records.record import FloatArray

if TYPE_CHECKING:
    from control import TransferFunction

PAPER_FACTOR = 0.292
"""The factor printed in Eq. (7); 1 - 10^(-3/20) = 0.29205 rounds to it."""

FALL_FACTOR = 10.0 ** (3.0 / 20.0) - 1.0
"""0.41254, in the place of Eq. (7)'s 0.292 where J_inner is negative: 1 / (1 + 0.41254) is -3 dB."""


def pure_torque_bandwidth(k_s: float, j_sc: float, factor: float = PAPER_FACTOR) -> float:
    """Return sqrt(0.292 K_s / J_sc) / (2 pi), Hz: up to it a pure torque source. Paper, Eq. (7).

    k_s: N m/rad. j_sc: kg m^2.
    """
    return math.sqrt(factor * k_s / j_sc) / (2.0 * math.pi)


def inner_inertia(rig: Rig) -> float:
    """Return J_sc + n J_r, kg m^2: (T_p - T_d) / q_c'' with both ends clamped.

    n J_r is the spin of the rotor, which Eqs. (5) to (7) leave out: J_m / N for a planetary train, negative
    where the rotor turns against the output (train.py). A lumped rotor counts with the whole J_m.
    """
    spin = spin_inertia(rig.train, rig["gear.ratio"], rig["rotor.reflected_inertia"])
    return rig["chassis.inertia"] + spin


def undamped_band(stiffness: float | FloatArray, inertia: float | FloatArray) -> FloatArray:
    """Return up to where an undamped K_s / (J s^2 + K_s) is within 3 dB, Hz: Eq. (7) for either sign of J.

    stiffness: K_s, N m/rad. inertia: J_inner, kg m^2. Above zero the response rises to a resonance and passes
    +3 dB, Eq. (7); below zero it falls without one and passes -3 dB; at zero it has no edge.
    """
    inertia = np.asarray(inertia, dtype=np.float64)
    with np.errstate(divide="ignore"):
        return np.asarray(np.sqrt(_factor(inertia) * stiffness / np.abs(inertia)) / (2.0 * np.pi))


def undamped_stiffness(band: float, inertia: float | FloatArray) -> FloatArray:
    """Return the K_s, N m/rad, whose undamped band is `band`, Hz: the inverse of undamped_band."""
    inertia = np.asarray(inertia, dtype=np.float64)
    return np.asarray((2.0 * np.pi * band) ** 2 / _factor(inertia) * np.abs(inertia))


def _factor(inertia: FloatArray) -> FloatArray:
    return np.where(inertia > 0.0, PAPER_FACTOR, FALL_FACTOR)


def end_to_end(rig: Rig, sees: Sees = "spring_and_damper") -> TransferFunction:
    """Return T_d / T_p of the rig with both ends clamped, exactly; Eq. (6) approximates it."""
    return distal_per_proximal(_hold_ends(rig), sees)


def end_over_end(rig: Rig) -> Fraction:
    """Return the same as a fraction, for who cannot wait for python-control."""
    return distal_over_proximal(_hold_ends(rig))


def _hold_ends(rig: Rig) -> Rig:
    return replace(rig, clamped=frozenset(END_NAMES))


def flat_band(
    function: TransferFunction | Fraction, tolerance_db: float = 3.0, tolerance_deg: float = 90.0
) -> float:
    """Return the frequency, Hz, up to which a transfer function stays within tolerances of 1, or inf.

    Exact: |f|^2 = 10^(±dB/10) and tan(arg f) = ±tan(deg) are polynomials in the frequency. 90 degrees leave
    the phase out of account. Raises ParameterError for impossible tolerances.
    """
    if not (tolerance_db > 0.0 and 0.0 < tolerance_deg <= 90.0):
        raise ParameterError(
            f"tolerances {tolerance_db:g} dB, {tolerance_deg:g} deg, expected > 0 dB, > 0 to 90 deg"
        )
    top, bottom = _parts(function)
    top_square, bottom_square = _inner(top, top), _inner(bottom, bottom)
    edges = [
        polynomial.polysub(top_square, 10 ** (db / 10.0) * bottom_square)
        for db in (tolerance_db, -tolerance_db)
    ]
    if tolerance_deg < 90.0:
        turned = polynomial.polysub(
            polynomial.polymul(top[1], bottom[0]), polynomial.polymul(top[0], bottom[1])
        )
        along, slope = _inner(top, bottom), math.tan(math.radians(tolerance_deg))
        edges += [polynomial.polysub(turned, sign * slope * along) for sign in (1.0, -1.0)]
    roots = np.concatenate([_positive_roots(edge) for edge in edges])
    return float(roots.min()) / (2.0 * math.pi) if len(roots) else math.inf


def edge_of_error(function: Fraction, tolerance: float) -> float:
    """Return the lowest frequency, Hz, at which |1/f - 1| is the tolerance; inf without."""
    difference = np.asarray(np.polysub(function.denominator, function.numerator), np.float64)
    top, bottom = (_inner(part, part) for part in _parts(Fraction(difference, function.numerator)))
    roots = _positive_roots(polynomial.polysub(top, tolerance**2 * bottom))
    return float(roots.min()) / (2.0 * math.pi) if len(roots) else math.inf


def resonance_peak(function: TransferFunction) -> tuple[float, float]:
    """Return where |f| is highest, Hz, and how high, dB; (0, gain at rest) where it only falls."""
    top, bottom = (_inner(part, part) for part in _parts(function))
    slope = polynomial.polysub(
        polynomial.polymul(polynomial.polyder(top), bottom),
        polynomial.polymul(top, polynomial.polyder(bottom)),
    )
    candidates = np.concatenate([[0.0], _positive_roots(slope)])
    gains = polynomial.polyval(candidates, top) / polynomial.polyval(candidates, bottom)
    best = int(np.argmax(gains))
    return float(candidates[best]) / (2.0 * math.pi), float(10.0 * np.log10(gains[best]))


_Complex = tuple[FloatArray, FloatArray]


def _parts(function: TransferFunction | Fraction) -> tuple[_Complex, _Complex]:
    """Return numerator and denominator at s = i w: real and imaginary polynomials in w, lowest first."""
    if isinstance(function, Fraction):
        return _at_imaginary(function.numerator), _at_imaginary(function.denominator)
    return _at_imaginary(function.num[0][0]), _at_imaginary(function.den[0][0])


def _at_imaginary(highest_first: FloatArray) -> _Complex:
    lowest_first = np.asarray(highest_first, dtype=np.float64)[::-1]
    values = lowest_first * 1j ** np.arange(len(lowest_first))
    return values.real, values.imag


def _inner(a: _Complex, b: _Complex) -> FloatArray:
    """Return Re(a conj(b)) as a polynomial."""
    product = polynomial.polyadd(polynomial.polymul(a[0], b[0]), polynomial.polymul(a[1], b[1]))
    return np.asarray(product, dtype=np.float64)


def _positive_roots(p: npt.NDArray[np.floating]) -> FloatArray:
    """Return the real roots above zero, rad/s."""
    roots = polynomial.polyroots(polynomial.polytrim(p))
    real: FloatArray = roots[(np.abs(roots.imag) <= 1e-9 * np.abs(roots)) & (roots.real > 0.0)].real
    return real
