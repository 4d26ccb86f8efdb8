"""A verdict never contradicts the number beside it."""

from __future__ import annotations

import re
from types import SimpleNamespace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from rsea_ros.diagnosis.criteria import verdict_of
from rsea_ros.diagnosis.naming.conclusion import main_channel
from rsea_ros.diagnosis.score import Score
from rsea_ros.diagnosis.settings import DEFAULT
from rsea_ros.report.diagnosis.words import diagnosis_sentence

FLOOR = DEFAULT.floor.reached
RATIOS = st.fixed_dictionaries({n: st.floats(0.3, 300.0) for n in ("ft", "position", "motor_torque")})
NEAR = st.fixed_dictionaries({n: st.floats(0.9, 1.3) for n in ("ft", "position", "motor_torque")})


def score_of(ratios):
    """Return the score of residuals with these ratios to the noise."""
    sums = {n: np.full(4, 100.0 * r**2) for n, r in ratios.items()}
    return Score(sums, {n: np.full(4, 100.0) for n in ratios})


@given(RATIOS | NEAR)
def test_nothing_is_wrong_exactly_when_every_residual_is_noise(ratios):
    score = score_of(ratios)
    at_noise = all(score.ratio(n) <= FLOOR for n in ratios)
    assert verdict_of([score]) == ("nothing_wrong" if at_noise else "unexplained")


@given(RATIOS | NEAR)
def test_the_sentence_speaks_of_a_channel_that_bears_the_verdict_out(ratios):
    score = score_of(ratios)
    verdict = verdict_of([score])
    channel = main_channel(score, "ft") if verdict == "unexplained" else "ft"
    rms = {channel: score.ratio(channel)}
    diagnosis = SimpleNamespace(
        verdict=verdict, channel=channel, causes=(), faults=(), remarks=(), at_noise_floor=False,
        noise_rms={channel: 1.0}, residual_rms=rms, extended_residual_rms=rms,
    )  # fmt: skip
    sentence = diagnosis_sentence(diagnosis)
    number = float(re.search(r"([\d.]+) times the noise", sentence)[1])
    assert (number <= FLOOR) == (verdict == "nothing_wrong"), sentence
