"""The threshold keeps the false alarms that it is derived from, and a change is found soon."""

import numpy as np
import pytest

from rsea_ros.health.recursive_estimates import Cusum, threshold

INNER, OUTER = np.array([1.0, 0.5]), np.array([2.0, 1.5])
NONE = np.ones(2)
EVERY = 3.0


def rate_of_alarms(h, change, looks, seed):
    """Alarms an hour of looks with scores of a change, of information drawn for each look."""
    rng, cusum, alarms = np.random.default_rng(seed), Cusum(INNER, OUTER, h), 0
    for _ in range(looks):
        information = rng.uniform(0.0, 3.0, 2)
        score = information * change + np.sqrt(information) * rng.standard_normal(2)
        if cusum.take(score, information, NONE):
            alarms += 1
            cusum.clear()
    return alarms / (looks * EVERY / 3600.0)


@pytest.mark.parametrize("change", [np.zeros(2), INNER])
def test_false_alarms_stay_below_the_stated_rate_even_at_the_edge_of_the_doubt(change):
    stated = 20.0
    h = threshold(stated, 4, EVERY)
    assert rate_of_alarms(h, change, 20_000, seed=1) <= stated
    assert rate_of_alarms(h, OUTER, 1_000, seed=1) > 5.0 * stated


def test_a_change_is_found_within_a_few_looks_and_only_with_excitation():
    cusum = Cusum(INNER, OUTER, threshold(1e-3, 4, EVERY))
    looks = 0
    while not cusum.take(np.array([40.0, 0.0]), np.array([20.0, 0.0]), NONE):
        looks += 1
    assert looks == 2 and cusum.since == 3
    cusum.clear()
    assert not any(cusum.take(np.zeros(2), np.zeros(2), NONE) for _ in range(1000)) and not cusum.suspects


def test_a_single_look_is_never_an_alarm():
    cusum = Cusum(INNER, OUTER, threshold(1e-3, 4, EVERY))
    assert not cusum.take(np.full(2, 1e9), np.full(2, 1.0), NONE) and cusum.suspects
