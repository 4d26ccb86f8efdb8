"""Simulated channels at the instants of a record's stamps, from their values at the ends of the steps."""

from __future__ import annotations

import numpy as np

from rsea_ros.compiler import njit
from rsea_ros.records.record import FloatArray


@njit(cache=True, nogil=True)
def _sample_smooth(values, at, command):  # type: ignore[no-untyped-def]
    """Interpolate values at steps 0, 1, 2, … at fractional steps, by cubics through four points.

    Where the command jumps a velocity has a kink: the points are taken from one side of it, and are fewer
    where a jump is not on the grid.
    """
    out, last = np.empty(len(at)), len(values) - 1
    for i in range(len(at)):
        u = min(max(at[i], 0.0), float(last))
        k = int(u)
        if u == k:
            out[i] = values[k]
            continue
        left, right = k, k + 1
        if left > 0 and command[left - 1] == command[k]:
            left -= 1
        while right < last and right - left < 3 and command[right] == command[k]:
            right += 1
        while left > 0 and right - left < 3 and command[left - 1] == command[k]:
            left -= 1
        out[i] = _newton(values, left, right, u - left)
    return out


@njit(cache=True, nogil=True)
def _newton(v, left, right, u):  # type: ignore[no-untyped-def]
    """Return Newton's polynomial through the two to four values from left to right, u steps after left."""
    value = v[left] + u * (v[left + 1] - v[left])
    if right - left > 1:
        value += u * (u - 1) / 2 * (v[left + 2] - 2 * v[left + 1] + v[left])
    if right - left > 2:
        value += u * (u - 1) * (u - 2) / 6 * (v[left + 3] - 3 * (v[left + 2] - v[left + 1]) - v[left])
    return value


@njit(cache=True, nogil=True)
def _sample_held(values, at):  # type: ignore[no-untyped-def]
    """Return the value of the step that ends nearest to each instant (a hold that just ended)."""
    out = np.empty(len(at))
    for i in range(len(at)):
        out[i] = values[min(max(int(np.rint(at[i])), 1), len(values) - 1)]
    return out


def sample(name: str, values: FloatArray, at: FloatArray, command: FloatArray) -> FloatArray:
    """Return a simulated channel at instants in steps since the start.

    values: at the ends of the steps, the initial one first, shape (steps + 1,). command: of each step.
    """
    smooth = name != "motor_torque"
    result: FloatArray = _sample_smooth(values, at, command) if smooth else _sample_held(values, at)
    return result
