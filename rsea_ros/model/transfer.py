"""Transfer functions of the rig, frequency responses from them, and up to where it is a pure torque source.

Cramer's rule on (M s^2 + D s + K) q = B tau gives every output over every torque on the same denominator
det(M s^2 + D s + K). For two clamped ends these are Eqs. (4) to (6) with the rotor's spin kept (outputs.py).
The rig's effects are left out; a pendulum counts as its small-angle stiffness. The band: Eq. (7), and the
exact one in magnitude and phase.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
from numpy.polynomial import polynomial

from rsea_ros.errors import ParameterError
from rsea_ros.model import outputs, propagator
from rsea_ros.model.equations import PORTS, mechanics
from rsea_ros.model.outputs import Output, Sees
from rsea_ros.model.rig import END_NAMES, Rig
from rsea_ros.model.train import spin_inertia
from rsea_ros.records.record import ComplexArray, FloatArray

if TYPE_CHECKING:
    from control import TransferFunction

_ROUNDING = 1e-12
"""A sum that is smaller than this part of its terms is zero."""


@dataclass(frozen=True)
class Fraction:
    """A transfer function as two polynomials in s, highest power first, without common powers of s."""

    numerator: FloatArray
    denominator: FloatArray

    def __call__(self, s: complex | npt.NDArray[np.complexfloating]) -> ComplexArray:
        """Return the values at s, rad/s, of its shape."""
        return np.asarray(np.polyval(self.numerator, s) / np.polyval(self.denominator, s))


def transfer(rig: Rig, output: Output, port: str = "gear") -> TransferFunction:
    """Return any output over the torque at any of equations.PORTS.

    Over T_m with both ends clamped, outputs.distal(rig, "element") is Eq. (4), and outputs.proximal(rig) is
    Eq. (5) with J_sc + n J_r for J_sc.
    """
    from control import TransferFunction  # takes a second, which no verb waits for

    fraction = _reduce(*_expand(rig, output, port))
    return TransferFunction(fraction.numerator, fraction.denominator)


def read(system: propagator.StateSpace, output: Output) -> tuple[FloatArray, FloatArray]:
    """Return C, shape (2n,), on the states (q, q'), and D, shape (5,), on the torques at the ports: q'' comes
    from the equations of motion."""
    placed, n = output.c @ system.mechanics.placement, system.mechanics.order
    c = np.concatenate([placed[0], placed[1]]) + placed[2] @ system.a[n:]
    return c, output.d + placed[2] @ system.b[n:]


def _expand(rig: Rig, output: Output, port: str) -> tuple[FloatArray, FloatArray]:
    """Return numerator and denominator, lowest power first."""
    m, p = mechanics(rig), PORTS.index(port)
    z = [
        [np.array([m.stiffness[i, j], m.damping[i, j], m.mass[i, j]]) for j in range(m.order)]
        for i in range(m.order)
    ]
    denominator = _determinant(z)
    placed = output.c @ m.placement
    terms = [output.d[p] * denominator]
    for i in range(m.order):
        replaced = [
            [m.ports[p, [r]] if j == i else row[j] for j in range(m.order)] for r, row in enumerate(z)
        ]
        terms.append(polynomial.polymul(placed[:, i], _determinant(replaced)))
    return _sum(terms), denominator


def _determinant(z: list[list[FloatArray]]) -> FloatArray:
    """Return the determinant of a matrix of polynomials, by its first row."""
    if len(z) == 1:
        return z[0][0]
    minors = ([[*row[:j], *row[j + 1 :]] for row in z[1:]] for j in range(len(z)))
    return _sum([(-1) ** j * polynomial.polymul(z[0][j], _determinant(m)) for j, m in enumerate(minors)])


def _sum(terms: Iterable[FloatArray]) -> FloatArray:
    """Add polynomials; a coefficient that is only rounding becomes zero."""
    terms = list(terms)
    table = np.zeros((len(terms), max(len(t) for t in terms)))
    for row, term in zip(table, terms, strict=True):
        row[: len(term)] = term
    total: FloatArray = table.sum(axis=0)
    total[np.abs(total) <= _ROUNDING * np.abs(table).sum(axis=0)] = 0.0
    return total


def _reduce(numerator: FloatArray, denominator: FloatArray) -> Fraction:
    """Return the fraction without common powers of s (a rig free to turn as a whole has them)."""
    common = min(int(np.argmax(p != 0.0)) for p in (numerator, denominator) if p.any())
    return Fraction(numerator[common:][::-1], denominator[common:][::-1])


def end_response(rig: Rig, hz: FloatArray, end: str = "spring_end") -> ComplexArray:
    """Return the torque at an end over the motor's at frequencies, Hz, shape (n,)."""
    return frequency_response(rig, outputs.end_torque(rig, end), hz)


def frequency_response(rig: Rig, output: Output, hz: FloatArray, port: str = "gear") -> ComplexArray:
    """Return output over torque at a port, (M s^2 + D s + K) q = B tau with s = 2 pi i f.

    hz: shape (n,), without 0 where the rig is free to turn as a whole. Returns shape (n,), in the output's
    unit per N m. A pendulum counts as its small-angle stiffness; the rig's effects are left out.
    """
    m = mechanics(rig)
    p = PORTS.index(port)
    s = 2j * np.pi * np.asarray(hz, dtype=np.float64)[:, None, None]
    moved = np.linalg.solve(m.mass * s**2 + m.damping * s + m.stiffness, m.ports[p][:, None])[..., 0]
    q = moved @ m.placement.T
    s = s[:, 0, 0]
    return np.asarray((np.stack([s**0, s, s**2], axis=1) @ output.c * q).sum(axis=1) + output.d[p])


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
    reflected = rig["rotor.reflected_inertia"]
    return rig["chassis.inertia"] + spin_inertia(rig.train, rig["gear.ratio"], reflected, rig.beside_spring)


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


def end_to_end(rig: Rig, sees: Sees = "spring_and_damper") -> Fraction:
    """Return T_d / T_p of the rig with both ends clamped, exactly; Eq. (6) approximates it."""
    clamped = replace(rig, clamped=frozenset(END_NAMES))
    ends = outputs.distal(clamped, sees), outputs.proximal(clamped)
    return _reduce(*(_expand(clamped, end, "gear")[0] for end in ends))


def flat_band(function: Fraction, tolerance_db: float = 3.0, tolerance_deg: float = 90.0) -> float:
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


def resonance_peak(function: Fraction) -> tuple[float, float]:
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


def _parts(function: Fraction) -> tuple[_Complex, _Complex]:
    """Return numerator and denominator at s = i w: real and imaginary polynomials in w, lowest first."""
    return _at_imaginary(function.numerator), _at_imaginary(function.denominator)


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
    return np.asarray(roots[(np.abs(roots.imag) <= 1e-9 * np.abs(roots)) & (roots.real > 0.0)].real)
