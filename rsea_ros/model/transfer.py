"""Transfer functions of the rig, and frequency responses from them.

Cramer's rule on (M s^2 + D s + K) q = B tau gives every output over every torque on the same denominator
det(M s^2 + D s + K). For two clamped ends these are Eqs. (4) to (6) with the rotor's spin kept (outputs.py).
The rig's effects are left out; a pendulum counts as its small-angle stiffness.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.polynomial import polynomial

from rsea_ros.model import outputs, propagator
from rsea_ros.model.equations import PORTS, mechanics
from rsea_ros.model.outputs import Output, Sees
from rsea_ros.model.rig import Rig
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

    def __call__(self, s: complex) -> complex:
        """Return the value at s, rad/s."""
        return complex(np.polyval(self.numerator, s) / np.polyval(self.denominator, s))


def distal_per_proximal(rig: Rig, sees: Sees = "spring_and_damper") -> TransferFunction:
    """Return T_d / T_p while the motor drives. Both ends clamped: Eq. (6) with J_sc + n J_r for J_sc."""
    return _transfer_function(distal_over_proximal(rig, sees))


def distal_over_proximal(rig: Rig, sees: Sees = "spring_and_damper") -> Fraction:
    """Return the same as a fraction."""
    above, _ = _expand(rig, outputs.distal(rig, sees), "gear")
    below, _ = _expand(rig, outputs.proximal(rig), "gear")
    return _reduce(above, below)


def transfer(rig: Rig, output: Output, port: str = "gear") -> TransferFunction:
    """Return any output over the torque at any of equations.PORTS.

    Over T_m with both ends clamped, outputs.distal(rig, "element") is Eq. (4), and outputs.proximal(rig) is
    Eq. (5) with J_sc + n J_r for J_sc.
    """
    return _transfer_function(_reduce(*_expand(rig, output, port)))


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


def _transfer_function(fraction: Fraction) -> TransferFunction:
    from control import TransferFunction

    return TransferFunction(fraction.numerator, fraction.denominator)


def frequency_response(rig: Rig, output: Output, hz: FloatArray, port: str = "gear") -> ComplexArray:
    """Return output over torque at a port, (M s^2 + D s + K) q = B tau with s = 2 pi i f.

    hz: shape (n,), without 0 where the rig is free to turn as a whole. Returns shape (n,), in the output's
    unit per N m. A pendulum counts as its small-angle stiffness; the rig's effects are left out.
    """
    m = mechanics(rig)
    p = PORTS.index(port)
    s = 2j * np.pi * np.asarray(hz, dtype=np.float64)[:, None, None]
    q = (
        np.linalg.solve(m.mass * s**2 + m.damping * s + m.stiffness, m.ports[p][:, None])[..., 0]
        @ m.placement.T
    )
    s = s[:, 0, 0]
    response: ComplexArray = (np.stack([s**0, s, s**2], axis=1) @ output.c * q).sum(axis=1) + output.d[p]
    return response
