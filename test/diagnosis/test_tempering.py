"""The weight of known values against data whose errors are not noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from rsea_ros.diagnosis.criteria import break_tie, refusal
from rsea_ros.diagnosis.score import Score, likelier_by, temper, tempered_loss
from rsea_ros.diagnosis.settings import DEFAULT
from rsea_ros.identification.unknowns import Unknown

FAR, BLOCKS, SAMPLES = DEFAULT.floor.far, 40, 100.0


def score(ratio, waves=0.0):
    """Return a score of one channel. waves: share of a block's loss by which neighbours differ."""
    sums = SAMPLES * ratio**2 * (1.0 + waves * np.resize([1.0, -1.0], BLOCKS))
    return Score({"ft": sums}, {"ft": np.full(BLOCKS, SAMPLES)})


@dataclass(frozen=True)
class Model:
    """The part of a candidate that the criteria use."""

    validation: Score
    prior_cost: float = 0.0
    causes: tuple[str, ...] = ("command_delay",)
    parameters: int = 7
    size: int = 1
    is_at_bound: bool = False


NOMINAL = Model(score(25.0), 10.0, (), 6, 0)


def test_a_right_models_gain_on_white_noise_counts_in_full():
    rng = np.random.default_rng(1)
    noise, missed = rng.normal(size=(400, 100)), 0.3
    gained = np.sum((noise + missed) ** 2 - noise**2, axis=1)
    assert temper(gained) == pytest.approx(1.0, abs=0.2)


def test_a_gain_that_only_some_blocks_share_counts_for_less():
    gained = np.resize([110.0, -90.0], BLOCKS)
    assert temper(gained) < 0.02
    assert temper(np.full(BLOCKS, 10.0)) == 1.0


def test_near_the_floor_nothing_is_tempered():
    near, other = score(1.0, 0.5), score(1.2, -0.5)
    assert tempered_loss(other, near, FAR) == pytest.approx(other.loss(near))
    far, worse = score(20.0, 0.5), score(24.0, -0.5)
    assert tempered_loss(worse, far, FAR).sum() < worse.loss(far).sum()


def test_far_from_the_floor_leaving_known_values_costs_more_than_an_uneven_gain():
    """An overshoot that bends to what is left, with a spring 2.5 sigmas and an inertia 13 from known."""
    bent = Model(score(19.0, 0.6), 200.0, ("current_loop_overshoot",), 8, 2)
    plain = Model(score(21.0, -0.2), 3.0)
    assert likelier_by(plain, bent, FAR) > 0.0 > likelier_by(bent, plain, FAR)
    assert break_tie([bent, plain], NOMINAL.validation)[0] is plain
    cheap = Model(bent.validation, 3.0, bent.causes, 7, 1)
    assert break_tie([cheap, plain], NOMINAL.validation)[0] is cheap


def test_a_cause_that_gains_less_than_known_values_lose_is_refused():
    uneven = score(21.0, 0.6)
    assert refusal(Model(uneven, 5.0), NOMINAL) is None
    assert refusal(Model(uneven, 5000.0), NOMINAL) == "leaves_priors"


@pytest.mark.parametrize(
    ("spread", "value", "sigmas"),
    [(1.0, 2.0, 1.0), (1.0, 4.0, 2.0), (1.0, 16.0, 4.0), (2.0, 9.0, 2.0), (1.0, 0.5, 0.5), (1.0, 0.0, 1.0)],
)
def test_a_wide_doubt_concerns_the_order_of_magnitude(spread, value, sigmas):
    damping = Unknown("spring.damping", 1.0, "N m s/rad", 0.0, np.inf, False, spread, 1.0)
    assert damping.sigmas(value) == pytest.approx(sigmas)


def test_a_narrow_doubt_counts_as_stated():
    stiffness = Unknown("spring.stiffness", 2155.0, "N m/rad", 0.2, 2e7, True, 0.1, 1.0)
    assert stiffness.sigmas(np.log(2764.0)) == pytest.approx(2.49, abs=0.01)
    assert Unknown("backlash.gap", 0.01, "rad", 0.0, 1.0, False, np.inf, 0.01).sigmas(0.5) == 0.0
