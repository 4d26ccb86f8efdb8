"""The blocks of a record and their sets; where its pieces lie and what state they begin in, by hand."""

from types import SimpleNamespace

import numpy as np
import pytest

from rsea_ros.diagnosis import data_split
from rsea_ros.diagnosis.settings import BlockSettings
from rsea_ros.model.drive import SpringStart

T = 5.0 + 0.01 * np.arange(400)
TWO = (10, 30), (40, 60)


def case(start=5.0, mask=None, duration=4.0, **measured):
    y = {n: np.asarray(v, float) for n, v in measured.items()}
    known = {n: np.ones(len(v), bool) if mask is None else mask for n, v in y.items()}
    return SimpleNamespace(start=start, duration=duration, t=dict.fromkeys(y, T), measured=y, mask=known)


def test_the_misfit_of_a_piece_is_its_share_of_the_power_of_all_channels():
    residual = np.where((T >= 6.0) & (T < 7.0), 2.0, 1.0)
    given = case(ft=residual, position=np.ones(400), velocity=np.zeros(400))
    outputs = {"ft": np.zeros(400), "position": np.zeros(400), "other": np.ones(400)}
    assert data_split.misfit_between(given, outputs, 1.0, 1.0) == pytest.approx(400.0 / 700.0 + 0.25)
    assert data_split.misfit_between(given, outputs, 0.0, 0.5) == pytest.approx(50.0 / 700.0 + 0.125)
    assert data_split.misfit_between(given, {"velocity": np.zeros(400)}, 0.0, 4.0) == 0.0
    half = case(ft=residual, mask=T >= 6.5)
    assert data_split.misfit_between(half, {"ft": np.zeros(400)}, 1.0, 1.0) == pytest.approx(200.0 / 400.0)


@pytest.mark.parametrize(
    ("spans", "begin", "end", "covered"),
    [((), -5.0, 99.0, True), (TWO, 1.0, 3.0, True), (TWO, 4.5, 5.0, True), (TWO, 0.9, 3.0, False),
     (TWO, 1.0, 3.1, False), (TWO, 2.0, 5.0, False)],
)  # fmt: skip
def test_a_piece_lies_in_one_span(spans, begin, end, covered):
    assert data_split._is_covered(SimpleNamespace(spans=spans, step=0.1), begin, end) == covered


def test_a_piece_begins_with_the_first_step_of_a_command():
    drive = SimpleNamespace(step=0.01, hold=4)
    begins = (1.0, 1.019, 1.021, 1.039, 1.061)
    assert [data_split.run_up_step(drive, begin, 0.5) for begin in begins] == [48, 48, 52, 52, 56]


@pytest.mark.parametrize(
    ("between", "samples"), [(0.01, 1), (0.005, 2), (0.0052, 1), (0.00508, 2), (0.02, 1), (0.0, 1000)]
)
def test_samples_to_a_command_are_whole_and_jitter_makes_none_less(between, samples):
    assert data_split._samples_in(0.01, between * np.arange(50)) == samples
    assert data_split._samples_in(0.01, np.zeros(1)) == 1


@pytest.mark.parametrize("period", [2, 4, 8, 12])
def test_every_phase_of_an_excitation_that_repeats_is_in_every_set(period):
    blocks = np.arange(400)
    for sets in (data_split.TRAIN, data_split.VALIDATION, data_split.TEST):
        assert set(blocks[np.isin(data_split.set_of(blocks), sets)] % period) == set(range(period))


@pytest.mark.parametrize(
    ("duration", "rule", "length"),
    [(160.0, BlockSettings(), 1.0), (60.0, BlockSettings(), 0.5), (8.0, BlockSettings(), 0.25),
     (8.0, BlockSettings(shortest=0.05), 8.0 / 120)],
)  # fmt: skip
def test_the_length_of_a_block_follows_the_record_and_the_settings(duration, rule, length):
    assert data_split.block_length(SimpleNamespace(duration=duration), rule) == length


def test_each_block_of_four_has_two_neighbours_to_train_and_their_starts_are_told():
    rule = BlockSettings()
    groups = int(rule.enough) // 4
    long = case(duration=max(4 * groups + 3, rule.enough) * rule.longest, ft=T)
    sets = data_split.set_of(np.arange(4 * groups)).reshape(groups, 4)
    every = [*data_split.TRAIN, *data_split.VALIDATION, *data_split.TEST]
    assert all(sorted(row) == every for row in sets.tolist())
    assert all(np.diff(np.flatnonzero(row < 2)).tolist() == [1] for row in sets)
    firsts = [4 * k + int(np.flatnonzero(row == 0)[0]) for k, row in enumerate(sets)]
    assert data_split.train_starts(long, rule) == pytest.approx(rule.longest * np.array(firsts))
    late = SimpleNamespace(duration=long.duration, start=5.0, t={"ft": 5.0 + rule.longest * np.arange(-1, 4)})
    assert data_split.blocks_of(late, "ft", rule).tolist() == [0, 0, 1, 2, 3]
    late.within = lambda mask: mask
    expected = np.isin(data_split.set_of(np.array([0, 0, 1, 2, 3])), data_split.TRAIN)
    assert data_split.part(late, data_split.TRAIN, rule)["ft"].tolist() == expected.tolist()


def test_the_state_of_a_piece_is_measured_or_a_line_beside_a_model():
    position, velocity = 0.1 + 2.0 * (T - 5.0), np.full(400, 2.0)
    assert data_split.state_at(case(ft=T), 6.0) == (0.0, 0.0)
    assert data_split.state_at(case(velocity=T), 6.005) == pytest.approx((0.0, 6.005))
    both = case(position=position, velocity=velocity)
    assert data_split.state_at(both, 6.005) == pytest.approx((2.11, 2.0))
    assert data_split.state_at(case(position=position), 6.005) == pytest.approx((2.11, 2.0))
    wave, slope = np.sin(30.0 * T), 30.0 * np.cos(30.0 * 6.005)
    found = data_split.state_at(case(position=position + wave), 6.005, {"position": wave})
    assert found == pytest.approx((2.11 + np.sin(30.0 * 6.005), 2.0 + slope), rel=2e-3)
    near = case(position=np.where(np.abs(T - 6.005) < 0.029, position, 99.0))
    assert data_split.state_at(near, 6.005) == pytest.approx((2.11, 2.0))
    assert data_split.state_at(case(position=position), T[-1]) == pytest.approx((position[-1], 2.0))


def test_the_spring_is_shown_by_its_encoder_or_else_by_ft():
    outputs = {"ft": np.zeros(400), "deflection": np.zeros(400)}
    both = case(ft=3.0 * T, deflection=0.01 * T)
    found = data_split.spring_at(both, 6.0, outputs)
    assert isinstance(found, SpringStart) and found.channel == "deflection"
    assert found[1:] == pytest.approx((0.06, 0.01))
    assert data_split.spring_at(case(ft=3.0 * T), 6.0, outputs).channel == "ft"
    assert data_split.spring_at(case(position=T), 6.0, outputs) is None
