"""The causal filter pair of the pure-torque flag, compiled: one state-variable filter with two outputs.

    high = s^2 / D,   low = w^2 / D,   D = s^2 + sqrt(2) w s + w^2   (Butterworth, power complementary)

For a sine of frequency f high = -(f / f_c)^2 low at every instant, so the ratio of their powers does not
ripple, and it crosses 1 at the corner f_c; of several sines their powers are shares of the whole. Trapezoidal
integration with w = tan(pi f_c dt) keeps the corner, and for every dt: stamps may jitter.
Source: Zavalishin, The Art of VA Filter Design, 2018, section 4.4.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from rsea_ros.signals import FloatArray

DAMPING = math.sqrt(2.0)
LENGTH = 256
"""Samples in the longest window."""


class Pair(NamedTuple):
    """State of the filter: integrators, time of the last sample (s), and squares of the last outputs.

    memory: s_1, s_2, t, next row, rows in use. squares: t (s), high^2, low^2, shape (LENGTH, 3).
    """

    memory: FloatArray
    squares: FloatArray


def empty_pair() -> Pair:
    """Return a pair that has heard nothing."""
    return Pair(np.array([0.0, 0.0, np.nan, 0.0, 0.0]), np.zeros((LENGTH, 3)))


@njit(cache=True, nogil=True, error_model="numpy")
def powers(pair, corner, window, t, torque):  # type: ignore[no-untyped-def]
    """Take in a torque (N m) at t (s); return the mean squares of high and low over the window (s), N^2 m^2.

    corner: Hz. After a pause in which the corner cannot be seen the pair begins anew.
    """
    memory, squares = pair
    dt = t - memory[2]
    memory[2] = t
    if not 0.0 < dt * corner < 0.45:
        memory[0], memory[1], memory[4] = 0.0, torque, 0.0
        return 0.0, torque * torque
    g = math.tan(math.pi * corner * dt)
    high = (torque - (DAMPING + g) * memory[0] - memory[1]) / (1.0 + g * (DAMPING + g))
    band = g * high + memory[0]
    low = g * band + memory[1]
    memory[0], memory[1] = g * high + band, g * band + low
    row = int(memory[3])
    squares[row, 0], squares[row, 1], squares[row, 2] = t, high * high, low * low
    memory[3], memory[4] = (row + 1) % LENGTH, min(memory[4] + 1, LENGTH)
    above = below = 0.0
    count = 0
    while count < memory[4] and t - squares[(row - count) % LENGTH, 0] < window:
        above += squares[(row - count) % LENGTH, 1]
        below += squares[(row - count) % LENGTH, 2]
        count += 1
    return above / count, below / count


def split(a: FloatArray, b: FloatArray, c: FloatArray, r: FloatArray, corner: float, dt: float) -> FloatArray:
    """Return the variances of high and low for the stationary signal c e, e = a e + b v, v of variances r.

    a: shape (n, n), b: (n, m), c: (n,), r: (m,). corner: Hz. dt: s.
    """
    g, n = math.tan(math.pi * corner * dt), len(a)
    to_high = np.array([-(DAMPING + g), -1.0, 1.0]) / (1.0 + g * (DAMPING + g))  # of s_1, s_2, input
    to_band = g * to_high + np.array([1.0, 0.0, 0.0])
    to_low = g * to_band + np.array([0.0, 1.0, 0.0])
    steps = np.array([g * to_high + to_band, g * to_band + to_low])
    whole, drive = np.zeros((n + 2, n + 2)), np.zeros((n + 2, b.shape[1]))
    whole[:n, :n], drive[:n] = a, b
    whole[n:, :n], whole[n:, n:], drive[n:] = (
        np.outer(steps[:, 2], c @ a),
        steps[:, :2],
        np.outer(steps[:, 2], c @ b),
    )
    p = _stationary(whole, drive @ np.diag(r) @ drive.T)
    return np.array([_variance(row, a, b, c, r, p) for row in (to_high, to_low)])


def _stationary(a: FloatArray, q: FloatArray) -> FloatArray:
    """Return sum_k a^k q a'^k over the first 2^16 samples, by doubling: also where a has not settled yet."""
    for _ in range(16):
        q = q + a @ q @ a.T
        a = a @ a
    return q


def _variance(
    row: FloatArray, a: FloatArray, b: FloatArray, c: FloatArray, r: FloatArray, p: FloatArray
) -> float:
    """Return the variance of row . (s_1, s_2, c e) from that of the states before the sample."""
    before = np.concatenate([row[2] * (c @ a), row[:2]])
    now = row[2] * (c @ b)
    return float(before @ p @ before + now @ (r * now))
