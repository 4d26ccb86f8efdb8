"""The loop: its formula against the code that runs, its margins against python-control and a bench."""

import numpy as np
import pytest

from rsea_ros.control.controller import TorqueController, TorqueLimits
from rsea_ros.control.following import closed_loop
from rsea_ros.control.law import (
    FT,
    VELOCITY,
    FeedbackState,
    Gains,
    feedback,
    hold,
    law_of,
    responses,
    sample_rig,
)
from rsea_ros.control.margins import largest_pole, margins, returns
from rsea_ros.control.synthesis import check, grid
from rsea_ros.control.uncertainty import LOCKED, load_range
from rsea_ros.errors import ParameterError
from rsea_ros.model.rig import EffectSetting
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import Plant

RATE = 280.0
GAINS = Gains(0.2575, 0.003029, 1.195, 6.99, 42.9)
LOCKED_RIG, FREE_RIG = load_rig("paper_high_impedance"), load_rig("paper_moving_output")


@pytest.fixture(scope="module")
def margins_by_load():
    """Margins of GAINS with every load."""
    return check(LOCKED_RIG, load_range(LOCKED_RIG, FREE_RIG), RATE, GAINS)


@pytest.mark.parametrize("rig", [LOCKED_RIG, FREE_RIG], ids=lambda rig: rig.name)
def test_the_sampled_bench_responds_as_the_simulated_one(rig):
    """A pulse into both; gravity and effects are in neither."""
    plant, model, x = Plant(rig, RATE, noise=False), sample_rig(rig, RATE), np.zeros(2)
    x = np.zeros(len(model.a))
    for k in range(60):
        torque = 10.0 if k < 3 else 0.0
        sample, x = plant.step(torque), model.a @ x + model.b * torque
        seen = [sample.ft, sample.velocity, sample.position, sample.position - sample.deflection]
        assert seen == pytest.approx(model.c @ x, rel=1e-5, abs=1e-9)


@pytest.mark.parametrize("hz", [1.0, 5.0, 17.5, 70.0])
def test_the_controller_answers_a_sine_as_the_formula_says(hz):
    """The controller measures a bench driven by a sine and answers with -L times it."""
    model, law = sample_rig(FREE_RIG, RATE), law_of(FREE_RIG, RATE, GAINS)
    at = np.array([hz])
    response = responses(model, at)
    turn = np.exp(2j * np.pi * hz / RATE * np.arange(4000))
    state, answers = FeedbackState(), []
    for ft, velocity in zip((response[FT, 0] * turn).real, (response[VELOCITY, 0] * turn).real, strict=True):
        torque, state = feedback(law, state, -ft, -velocity, ft, velocity)
        state = hold(state, torque)
        answers.append(torque)
    late = slice(-round(20 * RATE / hz), None)
    answer = 2.0 * np.mean((np.array(answers) * turn.conj())[late]) * np.exp(-2j * np.pi * hz / RATE)
    memory, whole = returns(law, response, at)
    assert answer == pytest.approx(1.0 - whole[0] / memory[0], rel=2e-2)


def test_margins_are_those_of_python_control():
    import control  # imported here: it brings matplotlib, a second in each worker

    loop = control.TransferFunction([4.0], [1.0, 3.0, 3.0, 1.0])
    hz = np.geomspace(1e-3, 10.0, 5000)
    ours = margins(np.asarray(loop(2j * np.pi * hz)), hz, period=0.01)
    gain, phase, modulus, _, crossover, _ = control.stability_margins(loop)
    assert ours.gain == pytest.approx(20.0 * np.log10(gain), rel=1e-3)
    assert ours.phase == pytest.approx(phase, rel=1e-3)
    assert ours.crossover == pytest.approx(crossover / (2.0 * np.pi), rel=1e-3)
    assert ours.sensitivity == pytest.approx(1.0 / modulus, rel=1e-3)
    assert ours.delay == pytest.approx(np.radians(phase) / crossover / 0.01, rel=1e-3)


@pytest.mark.parametrize("rig", [LOCKED_RIG, FREE_RIG], ids=lambda rig: rig.name)
def test_the_bench_is_stable_below_the_gain_margin_and_unstable_above(rig, margins_by_load):
    """With more torque per current the loop is stable below the margin and unstable above it."""
    name = LOCKED if rig is LOCKED_RIG else "free x 1"
    gain = 10.0 ** (margins_by_load.margins[name].gain / 20.0)
    rms = {}
    for share in (0.95, 1.05):
        true = rig.with_effects(EffectSetting("torque_constant_error", {"gain": share * gain}))
        controller = TorqueController(rig, RATE, GAINS, limits=TorqueLimits(1e9, 1e12, 0.0))
        ft = closed_loop(true, RATE, controller, np.zeros(600)).ft
        rms[share] = np.std(ft[400:]) / np.std(ft[100:300])
    assert rms[0.95] < 2.0 and rms[1.05] > 5.0


def test_poles_and_encirclements_agree(margins_by_load):
    plant, law = sample_rig(LOCKED_RIG, RATE), law_of(LOCKED_RIG, RATE, GAINS)
    edge = 10.0 ** (margins_by_load.margins[LOCKED].gain / 20.0)
    for share, stable in ((0.98, True), (1.02, False)):
        stronger = type(plant)(plant.a, plant.b * share * edge, plant.c, plant.period)
        assert (largest_pole(law, stronger) < 1.0) is stable


def test_gains_that_are_unstable_with_any_load_are_refused_with_that_load():
    loads = load_range(LOCKED_RIG, FREE_RIG)
    with pytest.raises(ParameterError, match=r"unstable at 280 Hz with load 'locked'.*modulus 1\.\d+"):
        check(LOCKED_RIG, loads, RATE, Gains(30.0, 0.1, 1.0, 50.0, 0.0))
    slow = LOCKED_RIG.with_effects(EffectSetting("command_delay", {"delay": 0.02}))
    with pytest.raises(ParameterError, match="the lags of its effects"):
        check(slow, load_range(slow, FREE_RIG), RATE, GAINS)
    assert grid(RATE)[-1] < 0.5 * RATE


def test_a_controller_of_another_rate_or_none_is_refused():
    controller = TorqueController(LOCKED_RIG, RATE, GAINS)
    with pytest.raises(ParameterError, match=r"rate = 500.0 Hz, expected that of the controller, 280.0 Hz"):
        closed_loop(LOCKED_RIG, 500.0, controller, np.zeros(3))
    with pytest.raises(ParameterError, match="controller: NoneType, expected a TorqueController"):
        closed_loop(LOCKED_RIG, RATE, None, np.zeros(3))
