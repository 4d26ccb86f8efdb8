"""sysidentpy: polynomial NARX of degree 2 by FROLS with AIC, run freely."""

from __future__ import annotations

import numpy as np
from common import PeerCase, PeerResult, scale
from sysidentpy.basis_function import Polynomial
from sysidentpy.model_structure_selection import FROLS
from sysidentpy.parameter_estimation import LeastSquares

LAGS, TERMS = 8, 30


def fit(case: PeerCase) -> PeerResult:
    """Select terms and run freely."""
    u, y, mean, size = scale(case)
    model = FROLS(
        order_selection=True, n_info_values=TERMS, ylag=LAGS, xlag=LAGS, info_criteria="aic",
        estimator=LeastSquares(), basis_function=Polynomial(degree=2),
    )  # fmt: skip
    model.fit(X=u[: case.split, None], y=y[:, None])
    begin = case.split - LAGS
    first = np.concatenate([y[begin:], np.zeros(len(u) - case.split)])
    run = np.ravel(model.predict(X=u[begin:, None], y=first[:LAGS, None]))[LAGS:]
    terms = len(np.ravel(model.theta))
    return PeerResult(mean + size * run[: len(u) - case.split], note=f"{LAGS} lags, {terms} terms")
