"""Weights of rival models from blocks that took part in no fit: pseudo-BMA with the Bayesian bootstrap.

    w_k = mean over bootstraps of softmax_k(-1/2 (sum_b v_b loss_kb + price_k))

v: Dirichlet weights of the blocks times their number. A rival that is ahead by a few blocks' luck does not
get all the weight, as it would from the sum alone (Yao, Vehtari, Simpson, Gelman, Bayesian Anal. 13, 2018).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rsea_ros.diagnosis.score import RESAMPLES
from rsea_ros.signals import FloatArray


def stacked(losses: Sequence[FloatArray], prices: Sequence[float]) -> FloatArray:
    """Return a weight for each model, shape (k,), summing to 1.

    losses: twice the negative log likelihood of every block, shape (b,) each. prices: of the priors, alike.
    """
    loss = np.array(losses)
    blocks = loss.shape[1]
    draws = np.random.default_rng(0).dirichlet(np.ones(blocks), RESAMPLES) * blocks
    evidence = -0.5 * (draws @ loss.T + np.asarray(prices))
    evidence -= evidence.max(axis=1, keepdims=True)
    likely = np.exp(evidence)
    return np.asarray((likely / likely.sum(axis=1, keepdims=True)).mean(axis=0))
