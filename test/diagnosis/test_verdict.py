"""A verdict never contradicts the number that it comes with."""

from __future__ import annotations

import re
from types import SimpleNamespace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from rsea_ros.diagnosis.conclusion import spoken_of
from rsea_ros.diagnosis.data_split import Score
from rsea_ros.diagnosis.sentences import verdict_sentence
from rsea_ros.diagnosis.verdict import FLOOR, verdict_of

RATIOS = st.fixed_dictionaries({n: st.floats(0.3, 300.0) for n in ("ft", "position", "motor_torque")})
NEAR = st.fixed_dictionaries({n: st.floats(0.9, 1.3) for n in ("ft", "position", "motor_torque")})


def judged(ratios):
    """Return a stage whose residuals are so many times the noise."""
    sums = {n: np.full(4, 100.0 * r**2) for n, r in ratios.items()}
    return SimpleNamespace(judged=Score(sums, {n: np.full(4, 100.0) for n in ratios}))


@given(RATIOS | NEAR)
def test_nothing_is_wrong_exactly_when_every_residual_is_the_noise(ratios):
    stage = judged(ratios)
    at_noise = all(stage.judged.ratio(n) <= FLOOR for n in ratios)
    assert verdict_of([stage]) == ("nothing_wrong" if at_noise else "unexplained")


@given(RATIOS | NEAR)
def test_the_sentence_speaks_of_a_channel_that_bears_the_verdict_out(ratios):
    score = judged(ratios).judged
    verdict = verdict_of([judged(ratios)])
    channel = spoken_of(score, "ft") if verdict == "unexplained" else "ft"
    sentence = verdict_sentence(verdict, (), channel, score.ratio(channel), score.ratio(channel), ())
    number = float(re.search(r"([\d.]+) times the noise", sentence)[1])
    assert (number <= FLOOR) == (verdict == "nothing_wrong"), sentence
