"""Runs: their rest, ramps, levels, lines and slew; their peaks, limits and files."""

import math

import numpy as np
import pytest

from rsea_ros.errors import ParameterError
from rsea_ros.experiment.run_shape import (
    RunLimits,
    Shape,
    _flat_multisine,
    command_of,
    largest_share,
    limits_from,
    limits_of,
    of_command,
    of_response,
    read_run,
    run_text,
    slow,
)

RATE = 200.0
LEAD, TAIL, RAMP = 70, 50, 50
"""Samples of 0.35, 0.25 and 0.25 s."""


def moving(shape, duration=8.0, **options):
    run = command_of(shape, duration, RATE, **options)
    assert len(run) == round(duration * RATE) + LEAD + TAIL
    assert not run[:LEAD].any() and not run[-TAIL:].any()
    return run[LEAD:-TAIL]


def test_a_staircase_goes_up_and_down_and_rests_at_its_end():
    run = moving(Shape("holds", 10.0, bias=2.0, hold=0.5, rest=0.25))
    assert len(run) == 1600 and not run[1200:].any()
    middles = run[100 + 50 : 1100 : 100]
    assert middles.tolist() == pytest.approx([9.0, 12.0, 9.0, 5.5, 2.0, -1.5, -5.0, -8.0, -5.0, -1.5])
    rise = run[:RAMP] / 5.5
    assert np.all(np.diff(rise) > 0.0) and rise[0] == 0.0
    assert rise[1:] + rise[:0:-1] == pytest.approx(np.ones(RAMP - 1))
    assert run[RAMP:100] == pytest.approx(np.full(50, 5.5))


def test_steps_go_up_and_down_by_their_levels():
    run = moving(Shape("steps", 10.0, hold=0.5))
    middles = run[50::100][:8]
    assert middles.tolist() == pytest.approx([10.0, -4.0, 7.0, -10.0, 3.0, -7.0, 4.0, 0.0])
    assert run[850:900] == pytest.approx(np.full(50, 10.0))


def test_a_short_run_ramps_for_a_quarter_of_itself():
    run = moving(Shape("holds", 10.0, hold=5.0), 0.4)
    assert np.flatnonzero(np.isclose(run, 3.5)).tolist()[:1] in ([19], [20])


@pytest.mark.parametrize("tilt", [0.0, 1.0])
def test_a_multisine_has_its_lines_with_their_tilt_and_a_low_crest(tilt):
    run = command_of(Shape("multisine", 10.0, low=2.0, high=30.0, tilt=tilt), 8.0, RATE)[LEAD:-TAIL]
    inner = run[RAMP:-RAMP]
    assert np.max(np.abs(inner)) == pytest.approx(10.0)
    whole = _flat_multisine(1600, RATE, 2.0, 30.0, tilt)
    assert np.max(np.abs(whole)) == pytest.approx(1.0)
    size = np.abs(np.fft.rfft(whole))
    lines = np.flatnonzero(size > 1e-6 * size.max())
    assert lines.tolist() == list(range(16, 241))
    assert size[lines] / size[16] == pytest.approx((lines / 16.0) ** -tilt)
    crest = 1.0 / np.sqrt(np.mean(whole**2))
    assert crest < (1.75 if tilt == 0.0 else 2.0)
    lowest = np.cos(2.0 * np.pi * np.arange(100) / 100.0)
    assert _flat_multisine(100, RATE, 0.1, 1.0, 0.0) == pytest.approx(lowest)


def test_a_chirp_sweeps_from_low_to_high_below_the_highest_frequency():
    run = moving(Shape("chirp", 10.0, low=2.0, high=500.0))
    turns = np.flatnonzero(np.diff(np.sign(run[RAMP:-RAMP])))
    assert np.max(np.abs(run)) == pytest.approx(10.0, rel=1e-2)
    assert np.diff(turns)[:3].mean() > 20.0 and np.diff(turns)[-20:].mean() < 1.5


def test_a_fast_change_makes_a_wave_smaller_and_a_step_a_ramp():
    wave = 10.0 * np.sin(2.0 * np.pi * np.arange(400) / 40.0)
    most = float(np.max(np.abs(np.diff(wave))))
    assert slow(wave, most, is_stepped=False) is wave
    assert slow(wave, 0.5 * most, is_stepped=False) == pytest.approx(0.5 * wave)
    late = np.append(wave[:5], 9.0)  # ends far from zero
    assert slow(late, 3.0, is_stepped=False) == pytest.approx(late / 3.0)
    assert slow(late[::-1].copy(), 3.0, is_stepped=False) == pytest.approx(late[::-1] / 3.0)
    step = np.repeat([0.0, 8.0, 0.0], 100)
    ramp = slow(step, 1.5, is_stepped=True)
    assert ramp[100:106] == pytest.approx(8.0 * np.arange(1, 7) / 6.0)
    assert ramp[106:200] == pytest.approx(np.full(94, 8.0))
    assert len(ramp) == 300 and np.max(np.abs(np.diff(ramp))) <= 1.5
    run = moving(Shape("steps", 10.0, hold=0.5), slew=100.0)
    assert np.max(np.abs(np.diff(run))) == pytest.approx(0.5, rel=0.03)


def test_peaks_are_those_of_command_and_response():
    command = np.array([0.0, 3.0, -1.0, 0.0, 2.0, 0.0, 0.0])
    peaks = of_command(command, 100.0)
    assert peaks == pytest.approx({"torque": 3.0, "slew": 400.0, "heat": math.sqrt(14.0 / 4.0)})
    assert of_command(np.array([5.0, 1.0]), 10.0)["slew"] == 50.0
    assert of_command(np.array([1.0, 5.0]), 10.0)["slew"] == 50.0
    assert of_command(np.zeros(3), 10.0) == {"torque": 0.0, "slew": 0.0, "heat": 0.0}
    outputs = {"velocity": np.array([1.0, -2.0, 0.5]), "position": np.array([0.1, 0.2, -0.3])}
    command = np.array([5.0, 2.0, -12.0])
    assert of_response(command, outputs) == {"velocity": 2.0, "travel": 0.3, "power": 6.0}
    felt = outputs | {"ft": np.array([-7.0, 1.0, 0.0]), "deflection": np.array([0.01, 0.0, 0.0])}
    assert of_response(command, felt) == {
        "velocity": 2.0, "travel": 0.3, "power": 6.0, "ft": 7.0, "deflection": 0.01,
    }  # fmt: skip


def test_the_largest_share_is_of_the_finite_limits_that_a_run_has():
    limits = RunLimits(20.0, velocity=4.0, power=1.0)
    assert limits.finite_limits() == {"torque": 20.0, "velocity": 4.0, "power": 1.0}
    assert largest_share({"torque": 10.0, "velocity": 3.0, "travel": 99.0}, limits) == 0.75
    assert largest_share({"torque": math.nan, "velocity": 3.0}, limits) == math.inf
    assert largest_share({}, limits) == 0.0


def test_limits_are_read_with_their_names():
    assert limits_from("torque=20, velocity = 0.5,") == RunLimits(20.0, velocity=0.5)
    for text, why in (
        ("velocity=1", "--limits: no torque, expected at least torque=… in N·m"),
        ("torque=much", "torque = 'much', expected a number in N·m"),
        ("torque=1,torque=2", "torque is given twice"),
        ("torqe=1", "'torqe', expected one of torque, slew"),
        ("torque=0", "limit torque = 0 N·m, expected > 0 N·m"),
        ("torque=1,slew=-2", "limit slew = -2 N·m/s, expected > 0 N·m/s"),
    ):
        with pytest.raises(ParameterError, match=why):
            limits_from(text)
    with pytest.raises(ParameterError, match="limits: no torque"):
        limits_of({})
    with pytest.raises(ParameterError, match="expected a finite torque"):
        RunLimits(math.inf)


def test_a_run_comes_back_from_its_file(tmp_path):
    path = tmp_path / "run.csv"
    command = 10.0 * np.random.default_rng(1).standard_normal(64)
    path.write_text(run_text(command, 280.0))
    read, rate = read_run(path)
    assert rate == pytest.approx(280.0) and read == pytest.approx(command, rel=1e-8)
    rows = path.read_text().splitlines()
    assert rows[0] == "t,command" and rows[2].startswith("0.00357142857,")
    jump, back = rows[:], rows[:]
    jump[-1], back[-1] = f"{63.5 / 280.0},1", f"{61.5 / 280.0},1"
    for lines, why in (
        ([], "begins with 'nothing', expected t,command"),
        (["time,torque"], "begins with 'time,torque'"),
        ([*rows, "1,x"], "expected two numbers a line"),
        (rows[:2], "lines or more of two finite numbers"),
        ([*rows[:-1], "1,nan"], "two finite numbers"),
        ([rows[0], *(f"{line},0" for line in rows[1:])], "two finite numbers"),
        (jump, "expected an even rate"), (back, "expected an even rate"),
    ):  # fmt: skip
        path.write_text("\n".join(lines))
        with pytest.raises(ParameterError, match=why):
            read_run(path)
