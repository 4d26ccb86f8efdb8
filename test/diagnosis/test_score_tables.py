"""Scores by hand: residuals over the noise by block, gains, and how far data may outweigh known values."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from independent.puzzle import noisy_resonance
from scripted_scores import BLOCKS, model, score

from rsea_ros.diagnosis import score as scores
from rsea_ros.diagnosis.criteria import likelier_by
from rsea_ros.diagnosis.data_split import TEST, TRAIN, VALIDATION
from rsea_ros.diagnosis.settings import BlockSettings
from rsea_ros.identification.problem import Case, case_from
from rsea_ros.model.drive import Drive
from rsea_ros.model.rig_file import load_rig

SECONDS = BlockSettings(longest=1.0, shortest=1.0)
NOISE = 2.0


def case(over_noise, names=("ft",)):
    """Return a record of two samples a second and a model's outputs, off by multiples of the noise.

    nan: a faulty sample.
    """
    errors = np.array(over_noise, float)
    t = 0.25 + 0.5 * np.arange(len(errors))
    drive = SimpleNamespace(t=np.array([0.0, 0.5 * len(errors)]))
    keep = np.isfinite(errors)
    measured = np.full(len(t), 10.0)
    made = Case(
        drive, dict.fromkeys(names, t), dict.fromkeys(names, measured), dict.fromkeys(names, NOISE),
        dict.fromkeys(names, keep),
    )  # fmt: skip
    return made, dict.fromkeys(names, measured + NOISE * np.nan_to_num(errors))


def score_of(*runs, channels=("ft", "position"), rule=SECONDS):
    cases, outputs = zip(*runs, strict=True)
    return scores.score(SimpleNamespace(channels=channels), tuple(cases), list(outputs), rule)


def test_residuals_count_over_the_noise_by_block_without_faulty_samples():
    result = score_of(case([1, np.nan, 3, 0, -1, 1]))
    assert result.sums["ft"].tolist() == [1.0, 9.0, 2.0]
    assert result.counts["ft"].tolist() == [1.0, 2.0, 2.0]
    assert result.ratio("ft") == pytest.approx(np.sqrt(12.0 / 5.0))
    assert list(result.sums) == ["ft"], "a channel that nobody measured has no score"


def test_a_short_record_has_shorter_blocks():
    result = score_of(case([1, 2, 3, 4]), rule=BlockSettings(longest=0.5, shortest=0.5))
    assert result.sums["ft"].tolist() == [1.0, 4.0, 9.0, 16.0]


def test_a_block_without_a_sound_sample_is_none():
    result = score_of(case([1, 1, np.nan, np.nan, 2, 2]))
    assert result.sums["ft"].tolist() == [2.0, 8.0]


def test_records_follow_each_other_and_may_lack_a_channel():
    result = score_of(case([1, 1, 1, 1]), case([2, 2], names=("position",)))
    assert result.sums["ft"].tolist() == [2.0, 2.0, 0.0]
    assert result.counts["ft"].tolist() == [2.0, 2.0, 0.0]
    assert result.sums["position"].tolist() == [0.0, 0.0, 8.0]


def test_each_sample_is_in_training_validation_or_test():
    run, outputs = case(np.arange(32.0))
    parts = [
        scores.score_on(SimpleNamespace(channels=("ft",)), [run], of, [outputs], SECONDS)
        for of in (TRAIN, VALIDATION, TEST)
    ]
    assert all(p.counts["ft"].sum() > 0 for p in parts)
    assert sum(p.counts["ft"].sum() for p in parts) == 32
    assert sum(p.sums["ft"].sum() for p in parts) == pytest.approx(np.sum(np.arange(32.0) ** 2))


@pytest.mark.parametrize(
    ("shares", "names", "missed"),
    [
        ([0.2, 0.6], ("ft",), 0.6),
        ([0.6, 0.2], ("ft",), 0.6),
        ([0.6], ("position",), 0.0),  # asked of the F/T torque alone
    ],
)
def test_the_largest_missed_response_of_all_records_counts(monkeypatch, shares, names, missed):
    left = iter(shares)

    def coherence(run, output, channel, blocks):
        assert channel == "ft"
        return next(left)

    monkeypatch.setattr(scores, "missed_response", coherence)
    assert score_of(*(case([1, 1], names) for _ in shares)).missed == missed


def test_a_model_without_the_measured_torque_misses_no_response(monkeypatch):
    monkeypatch.setattr(scores, "missed_response", lambda *_: 1.0)
    run, outputs = case([1, 1], names=("ft", "position"))
    assert score_of((run, {"position": outputs["position"]})).missed == 0.0


@pytest.mark.parametrize(
    ("now", "against", "loss"),
    [
        (score(ft=2.0), score(ft=4.0), 25.0),  # in units of the other's residual
        (score(ft=2.0), score(ft=0.5), 400.0),  # or of the noise where that is larger
        (score(ft=2.0, position=8.0), score(ft=2.0, position=4.0), 500.0),  # each channel in its own
    ],
)
def test_a_loss_is_in_units_of_the_other_models_residual(now, against, loss):
    assert now.loss(against).tolist() == [loss] * BLOCKS


def two_runs(first, second):
    """The score of two runs of 4 and 1 blocks, of residuals over the noise; nan: the run has no samples."""
    squares = np.array([first, first, first, first, second]) ** 2
    counts = np.where(np.isfinite(squares), 100.0, 0.0)
    return scores.Score({"ft": np.nan_to_num(100.0 * squares)}, {"ft": counts}, run=np.array([0, 0, 0, 0, 1]))


def test_each_run_counts_in_units_of_its_own_residual():
    """By one ratio for both, the run that the model misses hid what the other one shows."""
    before, after = two_runs(2.0, 50.0), two_runs(1.0, 25.0)
    assert before.loss(before).tolist() == [100.0] * 5
    assert after.loss(before).tolist() == [25.0] * 5
    assert before.loss(two_runs(0.5, 50.0)).tolist() == [400.0] * 4 + [100.0]


def test_a_run_without_samples_takes_the_ratio_of_all():
    score = two_runs(3.0, math.nan)
    assert score.ratios_in(0) == score.ratios_in(1) == {"ft": 3.0}
    assert score.loss(score).tolist() == [100.0] * 4 + [0.0]


def test_ratios_by_channel_and_the_worst():
    result = score(ft=2.0, position=8.0, velocity=0.5)
    assert result.ratios_in(0) == {"ft": 2.0, "position": 8.0, "velocity": 0.5}
    assert result.worst == "position"
    assert scores.Score({"ft": np.array([4.0])}, {"ft": np.array([1.0])}).ratio("ft") == 2.0
    assert scores.Score({"ft": np.zeros(1)}, {"ft": np.zeros(1)}).ratio("ft") == 0.0, "no sample, no residual"
    assert scores.Score({}, {}).missed == 0.0


def test_a_residual_of_zero_leaves_no_gain_undefined():
    value, (low, high) = scores.gain_of(np.zeros(4), np.array([0.0, 0.0, 0.0, 1.0]))
    assert (value, low, high) == (1.0, 1.0, 1.0)
    assert scores.gain_of(np.zeros(4), np.zeros(4)) == (1.0, (1.0, 1.0))


def test_the_interval_of_a_gain_is_that_of_blocks_drawn_anew():
    """Of 40 blocks that differ by 10 %: the mean is known to 10 % / sqrt(40), its root to half of that."""
    uneven = np.resize([1.1, 0.9], BLOCKS)
    value, (low, high) = scores.gain_of(uneven, np.ones(BLOCKS))
    width = 1.96 * 0.5 * 0.1 / np.sqrt(BLOCKS)
    assert value == pytest.approx(0.0, abs=1e-12)
    assert -low == pytest.approx(width, rel=0.06) and high == pytest.approx(width, rel=0.06)


def test_an_interval_leaves_out_what_happens_less_than_once_in_forty():
    """Two of ten blocks hold all the residual. Five of them or more are drawn once in 30, six once in 157."""
    two = np.array([1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    value, interval = scores.gain_of(two, np.ones(10))
    assert value == 1.0 - np.sqrt(0.2)
    assert interval == (1.0 - np.sqrt(0.5), 1.0)


def test_means_of_resampled_blocks_have_the_scatter_of_a_mean():
    means = scores.bootstrap_means(np.resize([1.0, -1.0], BLOCKS), 4000)
    assert means.shape == (4000,)
    assert means.mean() == pytest.approx(0.0, abs=0.01)
    assert means.std() == pytest.approx(1.0 / np.sqrt(BLOCKS), rel=0.05)


@pytest.mark.parametrize(
    ("differences", "weight"),
    [
        ([3.0, -1.0], 0.5),  # sum 2 claims a variance of 8, the blocks scatter by 16
        ([-3.0, 1.0], 0.5),
        ([2.0, 2.0, 2.0], 1.0),  # never more than in full
        ([5.0], 0.0),  # of one block nobody knows the scatter
    ],
)
def test_data_weigh_as_much_as_their_blocks_agree(differences, weight):
    assert scores.temper(np.array(differences)) == weight


@pytest.mark.parametrize(
    ("ratios", "far", "tempered"),
    [((4.0, 8.0), 4.0, True), ((4.0, 8.0), 4.5, False), ((8.0, 4.0), 4.5, False), ((8.0, 4.0), 4.0, True)],
)
def test_data_are_tempered_only_where_both_models_are_far_from_the_floor(ratios, far, tempered):
    one, other = score(ft=ratios[0], spread=0.5), score(ft=ratios[1], spread=-0.5)
    in_full = (one.loss(other) - other.loss(other)).sum()
    share = (scores.tempered_loss(one, other, far) - other.loss(other)).sum() / in_full
    assert 0.0 < share < 0.9 if tempered else share == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("ratio", "prior_cost", "by"), [(2.0, 3.0, -2.0), (2.0, 1.0, 0.0), (1.0, 3.0, 2998.0)]
)
def test_the_odds_are_those_of_the_data_and_of_the_known_values(ratio, prior_cost, by):
    one, other = model(ft=ratio, prior_cost=prior_cost), model(ft=2.0, prior_cost=1.0)
    assert likelier_by(one, other, 5.0) == by


def driven(count, error, *, rate=100.0, bad=()):
    """Return a record of white commands whose ft answers as the output does, but for an error of both."""
    dice = np.random.default_rng(4)
    command, own = dice.standard_normal(count), dice.standard_normal(count)
    t = (np.arange(count) + 0.5) / rate
    drive = Drive(1.0 / rate, 0.0, command, {}, np.zeros(0), np.zeros(0), (0.0, 0.0))
    output = 3.0 * command
    keep = ~np.isin(np.arange(count), bad)
    case = Case(drive, {"ft": t}, {"ft": output + error(output, own)}, {"ft": 1.0}, {"ft": keep})
    return case, output, np.arange(count) // 100


@pytest.mark.parametrize(
    ("share", "noise", "blocks", "bad", "missed"),
    [
        (0.2, 0.0, 16, (), 1.0), (-0.2, 0.0, 16, (), 1.0), (0.09, 0.0, 16, (), 0.0), (0.11, 0.0, 16, (), 1.0),
        (0.2, 0.0, 15, (), 0.0), (0.2, 0.0, 17, (150,), 1.0), (0.2, 0.0, 16, (150,), 0.0),
        (0.0, 1.0, 40, (), 0.0), (0.5, 1.0, 40, (), 1.5**2 / (1.0 + 1.5**2)),
    ],
)  # fmt: skip
def test_a_response_is_missed_from_a_tenth_of_it_on(share, noise, blocks, bad, missed):
    """Coherence^2 of what is left with the command; 16 sound blocks are needed."""
    made, output, of = driven(100 * blocks, lambda y, own: share * y + noise * own, bad=bad)
    found = scores.missed_response(made, output, "ft", of)
    assert found == pytest.approx(missed, abs=0.2 if noise and missed else 1e-6)


@pytest.mark.parametrize(("edge", "rate"), [(20.0, 100.0), (10.0, 100.0), (55.0, 280.0)])
def test_a_channel_is_lost_above_the_frequency_from_which_it_is_noise(edge, rate):
    def error(output, own):
        hz = np.fft.rfftfreq(len(output), 1.0 / rate)
        lost = np.fft.rfft(9.0 * own - output) * (hz > edge)
        return np.fft.irfft(lost, len(output))

    made, *_ = driven(20_000, error, rate=rate)
    assert scores.lost_above(made, "ft") == pytest.approx(edge, abs=0.02 * rate)
    for sound in (lambda y, own: 0.0 * y, lambda y, own: 99.0 * own):
        assert scores.lost_above(driven(20_000, sound, rate=rate)[0], "ft") is None
    assert scores.lost_above(driven(100, error, rate=rate)[0], "ft") is None, "too short"
    assert scores.lost_above(replace(made, drive=SimpleNamespace()), "ft") is None


@pytest.mark.parametrize(("seed", "seconds"), [(3, 30.0), (3, 50.0), (6, 100.0), (8, 50.0)])
def test_a_low_line_that_chance_has_lost_is_no_edge(seed, seconds):
    """With a few lines of two hundred below the edge, nearly all above such a line are lost, too."""
    case = case_from(noisy_resonance(seed, seconds), load_rig("paper_moving_output"))
    assert scores.lost_above(case, "ft") == pytest.approx(19.0, abs=1.0)
