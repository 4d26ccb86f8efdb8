"""Peers that know no physics: each continues the output from past inputs and outputs.

gp: Gaussian process NARX, a linear and a smooth kernel, on POINTS random samples, run freely. jax_sysid: a
linear model with four states by L-BFGS; its nonlinear models need a structure that the user states, and none
is stated here. sysidentpy: polynomial NARX of degree 2 by FROLS with AIC. lstm: one layer, trained by Adam
until the budget is spent. pysindy: sparse regression of the state's derivative on polynomials of degree 3 by
STLSQ, simulated; states are position and velocity where they are measured, else the output and its rate.
"""

import numpy as np
from common import PeerCase, PeerResult, scale

LAGS, POINTS, STATES, ROUNDS, TERMS = 8, 500, 4, 300, 30
HIDDEN, LENGTH, BATCH, SKIP, RATE = 32, 300, 16, 30, 3e-3
"""Of the LSTM: units; samples of a sequence; sequences of a step; samples at its start that no loss sees."""
DEGREE, THRESHOLD = 3, 0.01


def gp(case: PeerCase) -> PeerResult:
    """Fit to POINTS random samples and run freely."""
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, DotProduct, WhiteKernel

    u, y, mean, size = scale(case)
    past = [y[LAGS - k : len(y) - k] for k in range(1, LAGS + 1)]
    rows = np.column_stack([*past, *(u[LAGS - k : len(y) - k] for k in range(LAGS + 1))])
    chosen = np.random.default_rng(1).permutation(len(rows))[:POINTS]
    kernel = DotProduct() + RBF(np.full(rows.shape[1], 5.0), (0.1, 1e4)) + WhiteKernel(1e-4, (1e-12, 1.0))
    process = GaussianProcessRegressor(kernel).fit(rows[chosen], y[LAGS:][chosen])
    weights, x, k = process.alpha_, process.X_train_, process.kernel_
    longest, out = 10.0 * float(np.max(np.abs(y))), np.concatenate([y, np.zeros(len(u) - len(y))])
    for n in range(len(y), len(u)):
        row = np.concatenate([out[n - LAGS : n][::-1], u[n - LAGS : n + 1][::-1]])
        out[n] = np.clip(k(row[None, :], x)[0] @ weights, -longest, longest)
    return PeerResult(mean + size * out[len(y) :], note=f"{LAGS} lags, {POINTS} points")


def jax_sysid(case: PeerCase) -> PeerResult:
    """Fit a linear model, the example of its documentation."""
    import jax
    from jax_sysid.models import LinearModel

    jax.config.update("jax_enable_x64", True)
    u, y, mean, size = scale(case)
    model = LinearModel(STATES, 1, 1, feedthrough=False)
    model.loss(rho_x0=1e-3, rho_th=1e-2)
    model.optimization(lbfgs_epochs=ROUNDS, iprint=-1)
    model.fit(y[:, None], u[: case.split, None])
    run, _ = model.predict(np.ravel(model.x0), u[:, None])
    return PeerResult(mean + size * np.ravel(run)[case.split :], note=f"linear, {STATES} states")


def sysidentpy(case: PeerCase) -> PeerResult:
    """Select terms and run freely."""
    from sysidentpy.basis_function import Polynomial
    from sysidentpy.model_structure_selection import FROLS
    from sysidentpy.parameter_estimation import LeastSquares

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


def lstm(case: PeerCase) -> PeerResult:
    """Train, and run over all inputs."""
    import torch

    torch.manual_seed(1)
    torch.set_num_threads(1)
    u, y, mean, size = scale(case)
    inputs, targets = (torch.tensor(a, dtype=torch.float32) for a in (u, y))
    layer, readout = torch.nn.LSTM(1, HIDDEN, batch_first=True), torch.nn.Linear(HIDDEN, 1)
    optimizer = torch.optim.Adam([*layer.parameters(), *readout.parameters()], RATE)
    length, rounds = min(LENGTH, case.split - 1), 0
    while case.seconds_left > 0.15 * case.budget:
        starts = torch.randint(0, case.split - length, (BATCH,))
        at = starts[:, None] + torch.arange(length)
        run = readout(layer(inputs[at][..., None])[0])[..., 0]
        loss = torch.mean((run - targets[at])[:, SKIP:] ** 2)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        rounds += 1
    with torch.no_grad():
        run = readout(layer(inputs[None, :, None])[0])[0, case.split :, 0].numpy()
    return PeerResult(mean + size * run, note=f"{HIDDEN} units, {rounds} steps of Adam")


def pysindy(case: PeerCase) -> PeerResult:
    """Fit, and run freely from the last measured state by Runge-Kutta 4; a run that escapes stays put."""
    from pysindy import STLSQ, PolynomialLibrary, SINDy

    first = case.position[: case.split] if case.position.size else case.y[: case.split]
    speed = case.velocity[: case.split] if case.velocity.size else np.gradient(first, case.period)
    states = np.column_stack([first, speed])
    scaled, u, h = states / states.std(axis=0), case.u[:, None] / case.u.std(), case.period
    model = SINDy(optimizer=STLSQ(threshold=THRESHOLD), feature_library=PolynomialLibrary(degree=DEGREE))
    model.fit(scaled, t=h, u=u[: case.split])
    outputs = np.linalg.lstsq(scaled, case.y[: case.split], rcond=None)[0]
    law, library = model.coefficients().T, model.feature_library

    def rate(x, force):
        return np.asarray(library.transform(np.array([[*x, force]]))).reshape(-1) @ law

    run = [scaled[-1]]
    for force in u[case.split - 1 : -1, 0]:
        x = run[-1]
        a = rate(x, force)
        b = rate(x + 0.5 * h * a, force)
        c = rate(x + 0.5 * h * b, force)
        d = rate(x + h * c, force)
        run.append(np.clip(x + h / 6.0 * (a + 2.0 * b + 2.0 * c + d), -20.0, 20.0))
    return PeerResult(np.array(run)[1:] @ outputs, note=f"degree {DEGREE}, threshold {THRESHOLD:g}")
