"""The Gauss-Newton step on the rows, and its doubt.

The covariance is the sandwich over blocks of one second (identification/confidence.py says why).
"""

from __future__ import annotations

import numpy as np

from rsea_ros.checks.linear_rows import LinearisedRows, LinearSetting, LinearState
from rsea_ros.identification.unknowns import Unknown, start_vector
from rsea_ros.records.record import FloatArray

_OFFSET_DOUBT, _DRIFT_DOUBT, _GAIN_DOUBT = 0.05, 1e-3, 0.25
"""One sigma before: s, s/s, 1."""
_WIDER = 3.0


def gauss_newton_step(
    rows: LinearisedRows, setting: LinearSetting, state: LinearState
) -> tuple[FloatArray, FloatArray]:
    """Return the step of every unknown and its one sigma."""
    m, matrix = len(setting.timed), rows.matrix
    doubt = [_WIDER * _doubt(u) for u in setting.values]
    doubt += [_OFFSET_DOUBT] * m + [_DRIFT_DOUBT] * m + [np.inf] * m + [_GAIN_DOUBT] * m
    prior = np.array(doubt) ** -2.0
    off = state.theta - start_vector(setting.values)
    at = np.concatenate([off, -state.offset, -state.drift, np.zeros(2 * m)])
    normal = matrix.T @ matrix + np.diag(prior)
    scale = np.sqrt(np.diag(normal) + 1e-300)
    inverse = np.linalg.pinv(normal / np.outer(scale, scale), hermitian=True) / np.outer(scale, scale)
    step = -inverse @ (matrix.T @ rows.residual + prior * at)
    scores = _scores(rows, rows.residual + matrix @ step)
    covariance = inverse @ (scores.T @ scores + np.diag(prior)) @ inverse
    return step, np.sqrt(np.maximum(np.diag(covariance), np.diag(inverse)))


def _scores(rows: LinearisedRows, left: FloatArray) -> FloatArray:
    """Return the sum of the scores of each block, shape (blocks, unknowns)."""
    first = np.flatnonzero(np.diff(rows.block, prepend=-1))
    parts = np.add.reduceat(rows.matrix * left[:, None], first, axis=0)
    scores = np.zeros((int(rows.block.max()) + 1, rows.matrix.shape[1]))
    np.add.at(scores, rows.block[first], parts)
    return scores


def _doubt(u: Unknown) -> float:
    return u.doubt if np.isfinite(u.doubt) else u.scale
