"""A Gaussian process of past outputs and inputs (GP-NARX), run freely; scikit-learn's defaults else."""

from __future__ import annotations

import numpy as np
from common import PeerCase, PeerResult, free_run, narx_rows, scale
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, DotProduct, WhiteKernel

LAGS, POINTS = 8, 500


def fit(case: PeerCase) -> PeerResult:
    """Fit to POINTS random samples and run freely."""
    u, y, mean, size = scale(case)
    rows, targets = narx_rows(u, y, LAGS)
    chosen = np.random.default_rng(1).permutation(len(rows))[:POINTS]
    kernel = DotProduct() + RBF(np.full(rows.shape[1], 5.0), (0.1, 1e4)) + WhiteKernel(1e-4, (1e-12, 1.0))
    process = GaussianProcessRegressor(kernel).fit(rows[chosen], targets[chosen])
    weights, x, k = process.alpha_, process.X_train_, process.kernel_
    predicted = free_run(lambda row: float(k(row[None, :], x)[0] @ weights), u, y, LAGS)
    return PeerResult(mean + size * predicted, note=f"{LAGS} lags, {POINTS} points")
