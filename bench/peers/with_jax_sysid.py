"""jax-sysid: a linear model with four states by L-BFGS, as in its first example, simulated from its input.

Its nonlinear models need a structure that the user states; none is stated here.
"""

from __future__ import annotations

import jax
import numpy as np
from common import PeerCase, PeerResult, scale
from jax_sysid.models import LinearModel

STATES, ROUNDS = 4, 300


def fit(case: PeerCase) -> PeerResult:
    """Fit a linear model, the example of its documentation."""
    jax.config.update("jax_enable_x64", True)
    u, y, mean, size = scale(case)
    model = LinearModel(STATES, 1, 1, feedthrough=False)
    model.loss(rho_x0=1e-3, rho_th=1e-2)
    model.optimization(lbfgs_epochs=ROUNDS, iprint=-1)
    model.fit(y[:, None], u[: case.split, None])
    run, _ = model.predict(np.ravel(model.x0), u[:, None])
    predicted = np.ravel(run)[case.split :]
    return PeerResult(mean + size * predicted, note=f"linear, {STATES} states")
