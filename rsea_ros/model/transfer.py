"""Transfer functions of any rig, by expanding its equations of motion: exact polynomials, no roots, no grid.

Cramer's rule on (M s^2 + D s + K) q = B tau gives every output over every torque on the same denominator
det(M s^2 + D s + K). For two clamped ends these are Eqs. (4) to (6) with the rotor's spin kept (outputs.py).
The rig's effects are left out; a pendulum counts as its small-angle stiffness.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from control import StateSpace, TransferFunction
from numpy.polynomial import polynomial

from rsea_ros.model import outputs, propagator
from rsea_ros.model.equations import PORTS, mechanics
from rsea_ros.model.outputs import Output, Sees
from rsea_ros.model.rig import Rig
from rsea_ros.signals import FloatArray

_ROUNDING = 1e-12
"""A sum that is smaller than this part of its terms is zero."""


def distal_per_motor(rig: Rig, sees: Sees = "spring_and_damper") -> TransferFunction:
    """Return T_d / T_m. With both ends clamped and `element` it is Eq. (4)."""
    return transfer(rig, outputs.distal(rig, sees))


def proximal_per_motor(rig: Rig, sees: Sees = "spring_and_damper") -> TransferFunction:
    """Return T_p / T_m. With both ends clamped it is Eq. (5) with J_sc + n J_r for J_sc."""
    return transfer(rig, outputs.proximal(rig, sees))


def distal_per_proximal(rig: Rig, sees: Sees = "spring_and_damper") -> TransferFunction:
    """Return T_d / T_p while the motor drives. Both ends clamped: Eq. (6) with J_sc + n J_r for J_sc."""
    distal, _ = _fraction(rig, outputs.distal(rig, sees), "gear")
    proximal, _ = _fraction(rig, outputs.proximal(rig), "gear")
    return _transfer_function(distal, proximal)


def position_per_motor(rig: Rig) -> TransferFunction:
    """Return the encoder's angle over T_m, rad/(N m)."""
    return transfer(rig, outputs.position())


def transfer(rig: Rig, output: Output, port: str = "gear") -> TransferFunction:
    """Return any output over the torque at any of equations.PORTS."""
    return _transfer_function(*_fraction(rig, output, port))


def state_space(rig: Rig, output: Output, port: str = "gear") -> StateSpace:
    """Return the same in states (q, q'): q'' of the output comes from the equations of motion."""
    system, p = propagator.state_space(rig), PORTS.index(port)
    placed, n = output.c @ system.mechanics.placement, system.mechanics.order
    c = np.concatenate([placed[0], placed[1]]) + placed[2] @ system.a[n:]
    d = output.d[p] + placed[2] @ system.b[n:, p]
    return StateSpace(system.a, system.b[:, [p]], c[None, :], [[d]])


def _fraction(rig: Rig, output: Output, port: str) -> tuple[FloatArray, FloatArray]:
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
    """Add polynomials; what only rounding leaves of a coefficient becomes zero."""
    terms = list(terms)
    table = np.zeros((len(terms), max(len(t) for t in terms)))
    for row, term in zip(table, terms, strict=True):
        row[: len(term)] = term
    total: FloatArray = table.sum(axis=0)
    total[np.abs(total) <= _ROUNDING * np.abs(table).sum(axis=0)] = 0.0
    return total


def _transfer_function(numerator: FloatArray, denominator: FloatArray) -> TransferFunction:
    """Return the transfer function without common powers of s (a rig free to turn as a whole has them)."""
    common = min(int(np.argmax(p != 0.0)) for p in (numerator, denominator) if p.any())
    return TransferFunction(numerator[common:][::-1], denominator[common:][::-1])
