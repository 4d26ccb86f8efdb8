"""A command between its stamps, which are in steps: its mean over each step, by how it is held."""

from __future__ import annotations

import numpy as np

from rsea_ros.compiler import njit
from rsea_ros.records.record import FloatArray

ON_GRID = 1e-3
"""Stamps this near to the end of a step, in steps, are meant to be there: half a microsecond."""


def in_steps(t: FloatArray, start: float, step: float) -> FloatArray:
    """Return stamps (s) in steps since `start`; those on the grid but for their rounding are put on it."""
    at = (t - start) / step
    nearest = np.rint(at)
    result: FloatArray = np.where(np.abs(at - nearest) < ON_GRID, nearest, at)
    return result


@njit(cache=True, nogil=True)
def mean_of_held(at, y, count):  # type: ignore[no-untyped-def]
    """Return the mean over each step of the piecewise constant signal y held from its stamps (in steps)."""
    means, k = np.empty(count), 0
    for i in range(count):
        while k + 1 < len(at) and at[k + 1] <= i:
            k += 1
        total, since, j = 0.0, float(i), k
        while j + 1 < len(at) and at[j + 1] < i + 1:
            total += y[j] * (at[j + 1] - since)
            since, j = at[j + 1], j + 1
        means[i] = y[k] if j == k else total + y[j] * (i + 1 - since)
    return means


def mean_of_line(knots: FloatArray, y: FloatArray, count: int) -> FloatArray:
    """Return the mean over each step of the lines between the stamps (in steps), held beyond the last."""
    at = np.union1d(knots, np.arange(count + 1.0))
    line = np.interp(at, knots, y)
    area = np.concatenate([[0.0], np.cumsum(0.5 * (line[1:] + line[:-1]) * np.diff(at))])
    return np.diff(np.interp(np.arange(count + 1.0), at, area))


def mean_of_curve(finer: int, knots: FloatArray, y: FloatArray, count: int) -> FloatArray:
    """Return the mean over each step of the band-limited curve through samples `finer` steps apart.

    By Simpson's rule, from the Fourier series of the samples and their mirror image: no jump at the ends.
    """
    from scipy.signal import resample

    series = resample(np.concatenate([y, y[::-1]]), 4 * finer * len(y))[: 2 * finer * (len(y) - 1) + 1]
    means = (series[:-2:2] + 4.0 * series[1:-1:2] + series[2::2]) / 6.0
    return np.concatenate([means, np.full(count, y[-1])])[:count]


def beside_mean(knots: FloatArray, y: FloatArray, means: FloatArray, at: FloatArray) -> FloatArray:
    """Return the integral of the held signal minus the integral of its means, at instants; all in steps."""
    off_grid = at != np.rint(at)
    if not off_grid.any() or (knots == np.rint(knots)).all():
        return np.zeros(len(at))
    last = float(len(means))
    end = max(last, float(knots[-1]))
    held = np.concatenate([[0.0], np.cumsum(y * np.diff(knots, append=end))])
    stepped = np.concatenate([[0.0], np.cumsum(means)])
    inside = np.clip(at, 0.0, last)
    beside = np.interp(inside, np.append(knots, end), held) - np.interp(inside, np.arange(last + 1), stepped)
    return np.where(off_grid, beside, 0.0)
