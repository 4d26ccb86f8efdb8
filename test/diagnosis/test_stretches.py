"""Stretches of a long record: whole blocks with their sets, at their times, and where the model is worst."""

from dataclasses import replace

import numpy as np
import pytest
from runs import RATE, RIG, command_of, excited, trying

from rsea_ros import simulate
from rsea_ros.diagnosis import stretches
from rsea_ros.diagnosis.data_split import blocks_of, short_pieces_of
from rsea_ros.diagnosis.diagnose import diagnose
from rsea_ros.diagnosis.settings import DiagnosisSettings, StretchSettings
from rsea_ros.identification.noise_level import reestimate_noise
from rsea_ros.identification.problem import Problem, case_from
from rsea_ros.identification.solver import serial
from rsea_ros.model.rig_file import load_rig
from rsea_ros.records.record import MEASURED, Channel
from rsea_ros.report.remark_words import remark_sentences

SHORT = DiagnosisSettings(stretches=StretchSettings(enough=35.0, blocks=8, run_up=1.0))
"""Four slots of 8 s with three run-ups, a quarter of a record of 128 s."""


def record_of(seconds, rig=RIG):
    return excited(rig, sensors=3, duration=seconds, seed=3, amplitude=10.0)


@pytest.fixture(scope="module")
def drifting():
    """A rig whose spring softens, and a record of it as a case."""
    rig = RIG.with_effect("stiffness_drift", relative_change=-0.2)
    return rig, case_from(record_of(128.0, rig), rig)


def problem_of(case, rig=RIG):
    return Problem((case,), rig, (), MEASURED)


def test_spread_slots_reach_from_the_first_to_the_last():
    assert stretches.spread_slots(37, 5).tolist() == [0, 9, 18, 27, 36]
    assert stretches.spread_slots(3, 8).tolist() == [0, 1, 2]


def test_the_worst_slots_come_beside_the_spread_ones_in_time():
    misfit = np.array([9.0, 0.0, 1.0, 7.0, 8.0, 2.0])
    assert stretches.with_worst(np.array([0, 5]), misfit, 4).tolist() == [0, 3, 4, 5]
    assert stretches.with_worst(np.array([0, 5]), misfit, 2).tolist() == [0, 5]


def test_a_stretch_keeps_whole_blocks_with_their_sets_and_stamps(drifting):
    _, case = drifting
    cut = stretches.on_slots(case, [0, 2, 3, 7], SHORT)
    for n in case.t:
        block = blocks_of(cut, n, SHORT.blocks)
        whole = blocks_of(case, n, SHORT.blocks)
        chosen = np.isin(whole // 8, [0, 2, 3, 7])
        np.testing.assert_array_equal(block, whole[chosen])
        np.testing.assert_array_equal(cut.t[n], case.t[n][chosen])
        np.testing.assert_array_equal(cut.measured[n], case.measured[n][chosen])


def test_neighbouring_slots_are_simulated_in_one_go_and_the_rest_is_not(drifting):
    _, case = drifting
    cut = stretches.on_slots(case, [0, 2, 3, 7], SHORT)
    spans = [(a * cut.drive.step, b * cut.drive.step) for a, b in cut.drive.spans]
    assert [a for a, _ in spans] == pytest.approx([0.0, 15.0, 55.0], abs=0.01)
    assert [b for _, b in spans] == pytest.approx([8.0, 32.0, 64.0], abs=0.02)
    assert stretches.simulated_time(cut, SHORT) == pytest.approx(32.0, abs=0.1)


def test_a_stretch_is_simulated_as_in_the_whole_record_drifts_included(drifting):
    rig, case = drifting
    cut = stretches.on_slots(case, [0, 3, 7], SHORT)
    (whole,), (part,) = (problem_of(c, rig).outputs(np.zeros(0)) for c in (case, cut))
    for n, values in part.items():
        same = np.interp(cut.t[n], case.t[n], whole[n])
        assert np.max(np.abs(values - same)[cut.mask[n]]) < 0.1 * case.noise[n], n


def test_pieces_of_a_cut_record_lie_in_its_stretches(drifting):
    rig, case = drifting
    cut = stretches.on_slots(case, [1, 2, 5, 6], SHORT)
    pieces = short_pieces_of(cut, problem_of(cut, rig).outputs(np.zeros(0))[0], SHORT)
    assert len(pieces) > 5
    for piece in pieces:
        (out,) = problem_of(piece, rig).outputs(np.zeros(0))
        mask = piece.mask["ft"]
        left = (piece.measured["ft"] - out["ft"])[mask] / piece.noise["ft"]
        assert mask.sum() > 100
        assert np.abs(left).max() < 6.0, piece.start


def test_the_samples_of_a_problem_do_not_grow_with_the_record():
    """The derivatives of ten minutes at 1120 Hz took more than 1.5 GB."""
    seconds = 128.0
    t = (np.arange(round(4.0 * RATE * seconds)) + 1.0) / (4.0 * RATE)
    slow = record_of(seconds)
    fast = {n: Channel(t, np.interp(t, slow[n].t, slow[n].y)) for n in ("position", "velocity")}
    used = stretches.in_stretches(problem_of(case_from(slow.with_channels(**fast), RIG)), SHORT, serial)
    rows = len(used.residual(np.zeros(0))) / len(used.cases[0].t)
    assert rows <= 32.0 * RATE + 16


def test_a_swinging_load_has_run_ups_in_which_it_forgets_its_start():
    """Between two swinging ends 4 s left 30 times the noise of the encoder in every stretch."""
    rig = load_rig("two_moving_outputs")
    assert stretches.slowest_decay(rig) == pytest.approx(7.28, rel=1e-2)
    assert stretches.settings_for(RIG, DiagnosisSettings()).stretches.run_up == 4.0
    suited = stretches.settings_for(rig, replace(SHORT, stretches=replace(SHORT.stretches, enough=160.0)))
    assert suited.stretches.run_up == pytest.approx(4.0 * 7.28, rel=1e-2)
    case = case_from(record_of(256.0, rig), rig)
    (cut,) = stretches.in_stretches(problem_of(case, rig), suited, serial).cases
    (out,) = problem_of(cut, rig).outputs(np.zeros(0))
    left = (cut.measured["position"] - out["position"])[cut.mask["position"]] / cut.noise["position"]
    assert len(cut.drive.spans) > 1
    assert float(np.sqrt(np.mean(left**2))) < 1.1


def test_joins_of_stretches_do_not_pass_for_noise(drifting):
    """A residual that jumps from one stretch to the next raised the F/T noise a thousandfold."""
    rig, case = drifting
    cut = stretches.on_slots(replace(case, noise=dict.fromkeys(case.noise, 1e9)), [0, 3, 7], SHORT)
    (out,) = problem_of(cut, rig).outputs(np.zeros(0))
    offset = 100.0 * (cut.t["ft"] > cut.start + 20.0)
    right, jumping = (reestimate_noise(cut, {**out, "ft": ft}) for ft in (out["ft"], out["ft"] + offset))
    assert jumping.noise["ft"] == pytest.approx(right.noise["ft"], rel=0.1)


def test_a_cause_that_acts_for_four_seconds_of_a_long_record_is_named_and_sized():
    u = command_of(duration=128.0, seed=3, amplitude=10.0).y.copy()
    u[round(81.0 * RATE) : round(85.0 * RATE)] *= 6.0
    record = simulate(RIG.with_effect("torque_saturation", limit=25.0), u, RATE, seed=3)
    settings = trying("torque_saturation", stretches=SHORT.stretches)
    diagnosis = diagnose([record], RIG, settings=settings)
    assert [c.name for c in diagnosis.causes] == ["torque_saturation"]
    low, high = diagnosis.causes[0].parameters["limit"].ci95
    assert low < 25.0 < high
    used = next(r for r in diagnosis.remarks if r.code == "stretches")
    assert used.values == pytest.approx((32.0, 128.0), abs=0.1)
    assert "32 s of the 128 s" in remark_sentences([used])[0]
