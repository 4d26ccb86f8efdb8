"""Weights of rivals from held-out blocks."""

from __future__ import annotations

import numpy as np
import pytest

from rsea_ros.diagnosis.naming.weighing import stacking_weights

RNG = np.random.default_rng(3)
LOSS = RNG.chisquare(50, size=30)


def test_models_that_do_the_same_share_the_weight():
    assert stacking_weights([LOSS, LOSS], [0.0, 0.0]) == pytest.approx([0.5, 0.5])


def test_a_model_that_loses_more_in_every_block_gets_no_weight():
    assert stacking_weights([LOSS, LOSS + 3.0], [0.0, 0.0])[1] < 1e-6


def test_luck_in_a_few_blocks_does_not_decide():
    lucky = LOSS + np.where(np.arange(30) == 0, -30.0, 0.7)
    plain = 1.0 / (1.0 + np.exp(-0.5 * (LOSS.sum() - lucky.sum())))
    assert plain > 0.98
    assert stacking_weights([LOSS, lucky], [0.0, 0.0])[0] > 0.1


def test_the_cost_of_the_prior_counts():
    first, second = stacking_weights([LOSS, LOSS], [0.0, 4.0])
    assert first / second == pytest.approx(np.exp(2.0))
