"""How far a run would drive two hypotheses apart after the wrong one has been fitted to it.

    S_ij = min_d ||y_j + J_j d - y_i||^2 + d' L_j d

y: predictions over the noise; J_j: derivatives of the rival's; L_j: its information so far. S_ij / 2 is the
expected gain of the logarithm of the odds of i over j where i is true: T-optimality (Atkinson, Fedorov,
Biometrika 62, 1975), averaged over which is true (Ponce de Leon, Atkinson, Biometrika 78, 1991).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rsea_ros.experiment.hypothesis import Hypothesis, Response
from rsea_ros.identification.problem import Case
from rsea_ros.identification.solver import Map, jacobian, power, serial
from rsea_ros.signals import BoolArray, FloatArray

ENOUGH = 12.0
"""S that decides between two: odds of 400 to one, so that noise hardly ever turns them below 20."""


def separation(true: Response, rival: Response, information: FloatArray) -> float:
    """Return S of a rival, with the priors of its numbers."""
    difference = rival.predicted - true.if_there
    if not np.isfinite(difference).all():
        return 0.0
    slope = rival.slope.T @ difference
    reached = np.linalg.solve(rival.slope.T @ rival.slope + information, slope)
    return max(float(difference @ difference - slope @ reached), 0.0)


def separations(hypotheses: Sequence[Hypothesis], responses: Sequence[Response]) -> FloatArray:
    """Return S_ij where i is true and j its rival, shape (k, k); infinite on the diagonal."""
    k = len(hypotheses)
    table = np.full((k, k), np.inf)
    for i in range(k):
        for j in range(k):
            if i != j:
                table[i, j] = separation(responses[i], responses[j], hypotheses[j].information)
    return table


@dataclass(frozen=True)
class Refit:
    """A rival fitted to the prediction of another.

    total: S; data: its part from the run, without the cost to the
    rival of leaving its priors; only the part from the run grows with its length.
    """

    total: float
    data: float


_REFITS = 5


def refit(true: Hypothesis, rival: Hypothesis, case: Case, run: Map = serial) -> Refit:
    """Return S of a rival after a full fit: where values have to go far, one linear step leaves too much.

    case: the run, as run_case makes it. Gauss-Newton from the rival's values, steps halved where they fail.
    """
    predicted = replace(true.problem, cases=(case,)).outputs(true.if_there())[0]
    problem = replace(rival.problem, cases=(replace(case, measured=predicted),))
    low, high = rival.bounds()
    theta, start, known = rival.theta, rival.theta, rival.information
    residual = problem.residual(theta)
    cost = power(residual)
    for _ in range(_REFITS):
        slope = jacobian(problem, theta, residual, run)
        right = slope.T @ residual + known @ (theta - start)
        step = -np.linalg.solve(slope.T @ slope + known, right)
        for _ in range(4):
            trial = np.clip(theta + step, low, high)
            shifted = problem.residual(trial)
            paid = power(shifted) + float((trial - start) @ known @ (trial - start))
            if paid < cost:
                break
            step = 0.3 * step
        else:
            break
        fallen, theta, residual, cost = cost - paid, trial, shifted, paid
        if fallen < 0.01 * cost:
            break
    return Refit(cost, power(residual))


def nearest(table: FloatArray, apart: BoolArray) -> FloatArray:
    """Return for each hypothesis the S of its worst rival, shape (k,). apart: pairs that no run separates."""
    return np.asarray(np.where(apart, np.inf, table).min(axis=1))


def decided_share(table: FloatArray, probability: FloatArray, apart: BoolArray) -> float:
    """Return the share that a run is expected to decide: the mean of 1 - exp(-S / ENOUGH), S the worst."""
    worst = nearest(table, apart)
    share = np.where(np.isfinite(worst), -np.expm1(-np.minimum(worst, 1e6) / ENOUGH), 0.0)
    return float(probability @ share / max(probability.sum(), 1e-300))


def information_gain(hypothesis: Hypothesis, seen: Response) -> float:
    """Return the nats by which a run narrows a cause's own parameters, all others free (D-optimality).

    Half the logarithm of the ratio of the determinants of their information after and before.
    """
    indices = hypothesis.cause_indices or list(range(len(hypothesis.theta)))
    before = np.linalg.inv(hypothesis.information)[np.ix_(indices, indices)]
    after = np.linalg.inv(hypothesis.information + seen.slope.T @ seen.slope)[np.ix_(indices, indices)]
    return 0.5 * float(np.linalg.slogdet(before)[1] - np.linalg.slogdet(after)[1])
