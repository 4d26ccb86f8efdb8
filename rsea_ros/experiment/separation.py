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
from scipy.special import ndtr

from rsea_ros.experiment.hypothesis import Hypothesis, Response
from rsea_ros.identification.problem import Case
from rsea_ros.identification.solver import Map, jacobian, power, serial
from rsea_ros.records.record import BoolArray, FloatArray

SURE = float(np.log(19.0))
"""Logarithm of the odds that confirm a cause: 0.95 to 0.05."""


def separation(true: FloatArray, rival: Response, information: FloatArray) -> float:
    """Return S of a rival, with the priors of its numbers, where the prediction `true` is, shape (m,)."""
    difference = rival.predicted - true
    if not np.isfinite(difference).all():
        return 0.0
    slope = rival.slope.T @ difference
    reached = np.linalg.solve(rival.slope.T @ rival.slope + information, slope)
    return max(float(difference @ difference - slope @ reached), 0.0)


def separations(hypotheses: Sequence[Hypothesis], responses: Sequence[Response]) -> FloatArray:
    """Return S_ij where i is true and j its rival, shape (k, k); infinite on the diagonal."""
    return np.array([_row(r.if_there, i, hypotheses, responses) for i, r in enumerate(responses)])


def likely_separations(hypotheses: Sequence[Hypothesis], responses: Sequence[Response]) -> list[FloatArray]:
    """Return for each hypothesis its rows of S with each of its likely values, shape (m, k) each."""
    return [
        np.array([_row(true, i, hypotheses, responses) for true in r.likely]) for i, r in enumerate(responses)
    ]


def _row(
    true: FloatArray, i: int, hypotheses: Sequence[Hypothesis], responses: Sequence[Response]
) -> FloatArray:
    pairs = zip(responses, hypotheses, strict=True)
    rivals = enumerate(pairs)
    return np.array([np.inf if i == j else separation(true, r, h.information) for j, (r, h) in rivals])


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


def decided_share(hypotheses: Sequence[Hypothesis], chances: FloatArray) -> float:
    """Return the share of the cases that a run is expected to decide. chances: as chances_decided."""
    probability = np.array([h.probability for h in hypotheses])
    return float(probability @ chances / max(probability.sum(), 1e-300))


def chances_decided(
    hypotheses: Sequence[Hypothesis], rows: Sequence[FloatArray], apart: BoolArray
) -> FloatArray:
    """Return for each hypothesis, if it is true, the chance that a run decides it, shape (k,).

    That its log odds over the worst rival reach SURE: they become normal, with mean
    ln(p_i / p_j) + S_ij / 2 and variance S_ij. The mean over its likely values. rows: as
    likely_separations. apart: pairs that no run separates, shape (k, k).
    """
    odds = np.log(np.maximum([h.probability for h in hypotheses], 1e-300))
    return np.array([_chance(odds[i] - odds, rows[i], apart[i]) for i in range(len(rows))])


def _chance(odds: FloatArray, rows: FloatArray, apart: BoolArray) -> float:
    counts = np.isfinite(rows[0]) & ~apart
    if not counts.any():
        return 0.0
    s = np.maximum(rows[:, counts], 1e-12)
    return float(np.mean(ndtr(((odds[counts] + 0.5 * s - SURE) / np.sqrt(s)).min(axis=1))))


def information_gain(hypothesis: Hypothesis, seen: Response) -> float:
    """Return the nats by which a run narrows a cause's own parameters, all others free (D-optimality).

    Half the logarithm of the ratio of the determinants of their information after and before.
    """
    indices = hypothesis.cause_indices or list(range(len(hypothesis.theta)))
    before = np.linalg.inv(hypothesis.information)[np.ix_(indices, indices)]
    after = np.linalg.inv(hypothesis.information + seen.slope.T @ seen.slope)[np.ix_(indices, indices)]
    return 0.5 * float(np.linalg.slogdet(before)[1] - np.linalg.slogdet(after)[1])
