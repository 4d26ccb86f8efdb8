"""Models of which only the scores are given: the same residual in all blocks, so that ratios are exact."""

from dataclasses import dataclass

import numpy as np

from rsea_ros.diagnosis.score import Score

BLOCKS = 40


def score(missed=0.0, samples=100.0, spread=0.0, **ratios):
    """Return a score with the same residual over the noise in all blocks, or alternating by a share of it."""
    wave = 1.0 + spread * np.resize([1.0, -1.0], BLOCKS)
    sums = {n: samples * r**2 * wave for n, r in ratios.items()}
    return Score(sums, {n: np.full(BLOCKS, samples) for n in ratios}, missed)


@dataclass(frozen=True)
class Model:
    """The part of a candidate that the criteria use."""

    validation: Score
    causes: tuple[str, ...] = ()
    size: int = 1
    prior_cost: float = 0.0
    parameters: int = 7
    is_at_bound: bool = False


def model(*causes, size=1, prior_cost=0.0, parameters=7, at_bound=False, **ratios):
    return Model(score(**ratios), causes, size, prior_cost, parameters, at_bound)
