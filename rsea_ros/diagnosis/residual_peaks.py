"""Peaks of a spectrum, and the sine that stands behind one."""

from __future__ import annotations

import math

import numpy as np

from rsea_ros.signals import FloatArray

_MOST = 2


def peaks(level: FloatArray, apart: int) -> list[int]:
    """Return the places of the largest values that are more than so many bins apart."""
    level, found = level.copy(), []
    for _ in range(_MOST):
        k = int(np.argmax(level))
        if level[k] <= 0.0:
            break
        found.append(k)
        level[max(k - apart, 0) : k + apart + 1] = 0.0
    return found


def refined(bins: FloatArray, level: FloatArray, k: int) -> float:
    """Return where between the bins a peak is, by a parabola through the logarithms."""
    if not 0 < k < len(level) - 1 or min(level[k - 1 : k + 2]) <= 0.0:
        return float(bins[k])
    a, b, c = np.log(level[k - 1 : k + 2])
    return float(bins[k] + 0.5 * (a - c) / (a - 2.0 * b + c) * (bins[1] - bins[0]))


def sine_at(x: FloatArray, y: FloatArray, pulsation: float) -> dict[str, float]:
    """Return amplitude and phase (rad) of the sine of a pulsation in y(x)."""
    basis = np.column_stack([np.sin(pulsation * x), np.cos(pulsation * x)])
    a, b = np.linalg.lstsq(basis, y, rcond=None)[0]
    return {"amplitude": float(math.hypot(a, b)), "phase": float(math.atan2(b, a))}
