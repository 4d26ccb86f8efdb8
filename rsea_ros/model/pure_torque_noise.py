"""The powers of the flag's filter pair by the noise of a linear system's inputs, exactly."""

from __future__ import annotations

import math

import numpy as np

from rsea_ros.model.pure_torque_filter import DAMPING
from rsea_ros.records.record import FloatArray


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
