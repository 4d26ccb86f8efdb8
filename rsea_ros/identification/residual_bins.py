"""A residual laid out against something: bins, and its RMS in each."""

from __future__ import annotations

import numpy as np

from rsea_ros.records.record import FloatArray


def edges_of(values: FloatArray, count: int, *, equal: bool) -> FloatArray:
    """Return the edges of bins, rising: of equal width, or with equal numbers of values.

    Where many values are the same the bins are fewer than `count`.
    """
    shares = np.linspace(0.0, 1.0, count + 1)
    edges = np.linspace(values.min(), values.max(), count + 1) if equal else np.quantile(values, shares)
    distinct: FloatArray = np.unique(edges)
    return distinct if len(distinct) > 1 else np.array([distinct[0], distinct[0] + 1e-12])


def rms_in(edges: FloatArray, values: FloatArray, residual: FloatArray) -> FloatArray:
    """Return the RMS of the residual in each bin; NaN where a bin is empty."""
    count = len(edges) - 1
    which = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, count - 1)
    number = np.bincount(which, minlength=count).astype(float)
    power = np.bincount(which, residual**2, count) / np.where(number > 0.0, number, np.nan)
    rms: FloatArray = np.sqrt(power)
    return rms
