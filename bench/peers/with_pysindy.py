"""pysindy: sparse regression of the state's derivative on polynomials of degree 3, STLSQ, simulated.

States: position and velocity where they are measured, else the output and its derivative.
"""

from __future__ import annotations

import numpy as np
import pysindy
from common import PeerCase, PeerResult

DEGREE, THRESHOLD = 3, 0.01


def fit(case: PeerCase) -> PeerResult:
    """Fit, and run freely from the last measured state."""
    first = case.position[: case.split] if case.position.size else case.y[: case.split]
    speed = case.velocity[: case.split] if case.velocity.size else np.gradient(first, case.period)
    states = np.column_stack([first, speed])
    sizes, size_u = states.std(axis=0), case.u.std()
    scaled, u = states / sizes, case.u[:, None] / size_u
    library = pysindy.PolynomialLibrary(degree=DEGREE)
    model = pysindy.SINDy(optimizer=pysindy.STLSQ(threshold=THRESHOLD), feature_library=library)
    model.fit(scaled, t=case.period, u=u[: case.split])
    outputs = np.linalg.lstsq(scaled, case.y[: case.split], rcond=None)[0]
    run = _simulate(model, scaled[-1], u[case.split - 1 :, 0], case.period)
    return PeerResult(run[1:] @ outputs, note=f"degree {DEGREE}, threshold {THRESHOLD:g}")


def _simulate(model, state, u, period):
    """Return the states of a run, shape (n, 2), by Runge-Kutta 4; a run that escapes stays put."""
    law = model.coefficients().T
    library = model.feature_library

    def rate(x, force):
        return np.asarray(library.transform(np.array([[*x, force]]))).reshape(-1) @ law

    states = [np.asarray(state)]
    for force in u[:-1]:
        x = states[-1]
        a = rate(x, force)
        b = rate(x + 0.5 * period * a, force)
        c = rate(x + 0.5 * period * b, force)
        d = rate(x + period * c, force)
        states.append(np.clip(x + period / 6.0 * (a + 2.0 * b + 2.0 * c + d), -20.0, 20.0))
    return np.array(states)
