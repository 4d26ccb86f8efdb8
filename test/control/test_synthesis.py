"""Gains by synthesis: the loop's formula against the code that runs, its margins, and the set of benches."""

import math
from dataclasses import replace

import numpy as np
import pytest

from rsea_ros.control import following, synthesis
from rsea_ros.control.controller import TorqueController, TorqueLimits
from rsea_ros.control.following import closed_loop, follow
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
from rsea_ros.control.margins import impedance, largest_pole, margins, returns
from rsea_ros.control.robustness import NEAR, robustness, softness, spread
from rsea_ros.control.study import EFFECTS, hard, lagging_corners, sine, tracking_error
from rsea_ros.control.synthesis import check, design, grid
from rsea_ros.control.uncertainty import (
    LOCKED,
    Uncertainty,
    assumed,
    dense,
    load_range,
    load_uncertainty,
    mode_of,
)
from rsea_ros.errors import ParameterError
from rsea_ros.model.rig import EffectSetting
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import Plant
from test.control.benches import FREE, GAINS, LOADS, RATE, RIG, ROBUST, SET

BOTH = pytest.mark.parametrize("rig", [RIG, FREE], ids=lambda rig: rig.name)


@pytest.fixture(scope="module")
def designed():
    """The design for the paper's actuator at 280 Hz."""
    return design(RIG, LOADS, RATE)


@pytest.fixture(scope="module")
def edges():
    """By load, how many times the torque per current makes GAINS unstable."""
    found = check(RIG, LOADS, RATE, GAINS).margins
    return {rig.name: 10.0 ** (found[load].gain / 20.0) for rig, load in ((RIG, LOCKED), (FREE, "free x 1"))}


@BOTH
def test_the_sampled_bench_responds_as_the_simulated_one(rig):
    """A pulse into both; gravity and effects are in neither."""
    plant, model = Plant(rig, RATE, noise=False), sample_rig(rig, RATE)
    x = np.zeros(len(model.a))
    for k in range(60):
        torque = 10.0 if k < 3 else 0.0
        sample, x = plant.step(torque), model.a @ x + model.b * torque
        seen = [sample.ft, sample.velocity, sample.position, sample.position - sample.deflection]
        assert seen == pytest.approx(model.c @ x, rel=1e-5, abs=1e-9)


@pytest.mark.parametrize("hz", [1.0, 5.0, 17.5, 70.0])
def test_the_controller_answers_a_sine_as_the_formula_says(hz):
    """The controller measures a bench driven by a sine and answers with -L times it."""
    law, at = law_of(FREE, RATE, GAINS), np.array([hz])
    response = responses(sample_rig(FREE, RATE), at)
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


def test_margins_are_those_that_follow_by_hand():
    """4 / (s + 1)^3 is -1/2 at sqrt(3) rad/s, and of size one where (1 + w^2)^3 = 16."""
    hz = np.geomspace(1e-3, 10.0, 5000)
    ours = margins(4.0 / (1.0 + 2j * np.pi * hz) ** 3, hz, period=0.01)
    crossover = math.sqrt(16.0 ** (1.0 / 3.0) - 1.0)
    phase = math.pi - 3.0 * math.atan(crossover)
    w = np.linspace(1.0, 2.0, 10001)
    assert ours.gain == pytest.approx(20.0 * math.log10(2.0), rel=1e-3)
    assert ours.phase == pytest.approx(math.degrees(phase), rel=1e-3)
    assert ours.crossover == pytest.approx(crossover / (2.0 * np.pi), rel=1e-3)
    assert ours.sensitivity == pytest.approx(np.max(1.0 / np.abs(1.0 + 4.0 / (1.0 + 1j * w) ** 3)), rel=1e-3)
    assert ours.delay == pytest.approx(phase / crossover / 0.01, rel=1e-3)


@BOTH
def test_the_bench_is_stable_below_the_gain_margin_and_unstable_above(rig, edges):
    rms = []
    for share in (0.95, 1.05):
        true = rig.with_effects(EffectSetting("torque_constant_error", {"gain": share * edges[rig.name]}))
        controller = TorqueController(rig, RATE, GAINS, limits=TorqueLimits(1e9, 1e12, 0.0))
        ft = closed_loop(true, RATE, controller, np.zeros(600)).ft
        rms.append(np.std(ft[400:]) / np.std(ft[100:300]))
    assert rms[0] < 2.0 and rms[1] > 5.0


def test_poles_and_encirclements_agree(edges):
    plant, law = sample_rig(RIG, RATE), law_of(RIG, RATE, GAINS)
    for share, stable in ((0.98, True), (1.02, False)):
        stronger = type(plant)(plant.a, plant.b * share * edges[RIG.name], plant.c, plant.period)
        assert (largest_pole(law, stronger) < 1.0) is stable


SLOW = RIG.with_effect("command_delay", delay=0.02)
REFUSED = {
    "unstable with a load": (
        RIG, Gains(30.0, 0.1, 1.0, 50.0, 0.0), Uncertainty(),
        r"unstable at 280 Hz with load 'locked'.*modulus 1\.\d+",
    ),
    "the lags": (SLOW, GAINS, Uncertainty(), "the lags of its effects"),
    # They had 45 degrees of phase margin locked and 35 free, and were unstable with 2 ms and the mode.
    "nominal ones for the set": (
        RIG, Gains(1.469, 0.01116, 0.0, 89.2, 0.0), SET, r"unstable at 280 Hz with load .* mode",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_gains_that_are_unstable_are_refused_with_their_bench(case):
    rig, gains, known, told = REFUSED[case]
    with pytest.raises(ParameterError, match=told):
        check(rig, load_range(rig, FREE), RATE, gains, known)
    assert grid(RATE)[-1] < 0.5 * RATE


def test_a_rate_at_which_no_gains_are_found_is_refused(monkeypatch):
    """Looked for in a few places only: a whole search finds none at 50 Hz either."""
    monkeypatch.setattr(synthesis, "EVALUATIONS", 12)
    told = r"no gains keep the whole set .* at 50 Hz: largest sensitivity [\d.]+, expected 3 \(K_s ± 10 %"
    with pytest.raises(ParameterError, match=told):
        design(RIG, LOADS, 50.0)


def test_a_controller_of_another_rate_or_none_is_refused():
    controller = TorqueController(RIG, RATE, GAINS)
    with pytest.raises(ParameterError, match=r"rate = 500.0 Hz, expected that of the controller, 280.0 Hz"):
        closed_loop(RIG, 500.0, controller, np.zeros(3))
    with pytest.raises(ParameterError, match="controller: NoneType, expected a TorqueController"):
        closed_loop(RIG, RATE, None, np.zeros(3))


def test_no_neighbour_that_keeps_the_demands_is_clearly_better(designed):
    """Less friction or a softer feel costs one of the demands."""

    def worth(design):
        felt = impedance(RIG, RATE, design.gains, np.array([0.1, 0.3, 1.0, 3.0]))
        return np.log(design.friction_left) + np.mean(np.log(np.abs(felt.controlled / felt.spring)))

    problem = synthesis._problem(RIG, LOADS, RATE, grid(RATE), designed.uncertainty)
    for name in ("k_p", "k_d", "k_i", "q_frequency", "k_w"):
        for factor in (0.93, 1.07):
            gains = replace(designed.gains, **{name: factor * getattr(designed.gains, name)})
            other = synthesis._design(problem, gains)
            short = other.sensitivity > 3.01 or other.impedance > 1.0 + designed.impedance - 0.999
            assert short or worth(other) > worth(designed) - 0.05


def test_the_designed_controller_meets_its_limits(designed, monkeypatch):
    """At the rate of the nodes. `rsea control` prints more trials of the same kinds (golden: at 140 Hz)."""
    swept = robustness(RIG, LOADS, designed)
    assert swept.cases == 400 and swept.unstable == 0 and swept.sensitivity < 3.15
    for each in designed.margins.values():  # |S| <= 2 is 6 dB and 29 degrees
        assert each.sensitivity <= 2.02 and each.phase >= 28.9 and each.gain >= 5.95
    monkeypatch.setattr(following, "SINES", (1.0, 5.0, 10.0, 15.0, 20.0, 27.0))
    assert sine(RIG, RIG, designed) < 0.02 and follow(RIG, RIG, designed).bandwidth > 19.1
    rough = RIG.with_effects(EFFECTS[0])
    assert sine(rough, RIG, designed) < 0.06 and sine(rough, rough, designed) < 0.025
    for load, most in ((LOCKED, 0.08), ("free x 0.5", 0.05)):
        stiff, _ = lagging_corners(load, designed.uncertainty)
        assert tracking_error(RIG, LOADS, stiff, designed) < most, load


def test_a_bench_that_lags_has_less_room_for_the_same_gains(designed):
    slow = RIG.with_effect("current_loop_lag", time_constant=2e-3)
    problem = synthesis._problem(slow, load_range(slow, FREE), RATE, grid(RATE), designed.uncertainty)
    assert synthesis._design(problem, designed.gains).sensitivity > 1.1 * designed.sensitivity


def test_loads_reach_from_locked_to_free():
    assert list(LOADS)[:2] == [LOCKED, "free x 0.5"]
    assert LOADS["free x 10"]["housing_end.inertia"] == pytest.approx(1.01)
    assert all(load["rotor.reflected_inertia"] == RIG["rotor.reflected_inertia"] for load in LOADS.values())
    with pytest.raises(ParameterError, match="both ends are clamped"):
        load_range(RIG, RIG)


@pytest.mark.parametrize("name", ["bare_drive", "pendulum"])
def test_a_rig_without_a_torque_to_feel_is_refused(name):
    with pytest.raises(ParameterError, match=r"spring\.rigid"):
        design(load_rig(name), load_range(load_rig(name)), RATE)


def test_a_simulated_bench_of_the_set_lies_within_the_band(monkeypatch):
    """The mode rings in the sensor and not in the torque, so it is taken out of what the sensor read."""
    monkeypatch.setattr(following, "SINES", (2.0, 5.0, 10.0, 15.0, 27.0, 50.0))
    apart, near = spread(RIG, LOADS, ROBUST, (LOCKED,)), follow(RIG, RIG, ROBUST, learn=False)
    far = follow(hard(LOADS, SET), RIG, ROBUST, late=1, learn=False)
    beyond = 20.0 * np.log10(np.abs(far.torque / mode_of(SET.mode, far.hz) / near.torque))
    low, high = (np.interp(far.hz, apart.hz, edge) for edge in apart.gain)
    below = far.hz < 60.0  # above, the delay of 2 ms is not that of a held command
    assert np.all((beyond > low - 0.3)[below]) and np.all((beyond < high + 0.3)[below])
    assert beyond[far.hz == 15.0] > 3.0  # no nominal bench in a wide band


def test_the_band_is_about_the_nominal_bench_also_of_the_output():
    for names in ((LOCKED,), NEAR):
        apart = spread(RIG, LOADS, ROBUST, names)
        for low, high in (apart.gain, apart.phase):
            assert np.all(low <= 1e-9) and np.all(high >= -1e-9)
        assert np.abs(apart.gain[1][0]) < 0.2  # integral action leaves nothing at rest
    nominal = softness(RIG, ROBUST, np.geomspace(0.1, 120.0, 60))
    assert np.all(nominal.low <= nominal.high) and 1.2 < nominal.worst < 3.0


def test_a_file_states_what_it_knows_and_leaves_the_rest(tmp_path):
    path = tmp_path / "set.yaml"
    path.write_text(
        "stiffness: 0.05\ndelay: {value: 2, unit: ms}\nlate_samples: 2\n"
        "mode: {frequency: {value: 33, unit: Hz}, damping_ratio: 0.02, participation: 0.3}\n"
    )
    stated = load_uncertainty(path, RIG, RATE)
    assert stated == Uncertainty(0.05, 0.5, 0.0, 2, 2e-3, (33.0, 0.02, 0.3))
    assert "33 Hz" in str(stated) and "2 samples late" in str(stated)
    modes = {case.mode for case in dense([LOCKED], stated)}
    assert modes == {None, (33.0, 0.02, 0.15), (33.0, 0.02, 0.3)}


@pytest.mark.parametrize(("text", "told"), [
    ("delay: {value: 2, unit: m}", r"line 1: delay.unit = 'm', expected 's'"),
    ("stiffness: 2", r"line 1: stiffness = 2, expected 0 to 0.9"),
    ("stifness: 0.1", r"unknown key 'stifness'"),
    ("late_samples: 0.5", r"late_samples = 0.5, expected a whole number"),
    ("mode: {frequency: {value: 33, unit: Hz}}", r"mode.damping_ratio"),
    ("- 1", r"expected a mapping"),
])  # fmt: skip
def test_what_is_wrong_in_a_file_is_told_in_one_line(tmp_path, text, told):
    path = tmp_path / "set.yaml"
    path.write_text(text)
    with pytest.raises(ParameterError, match=told) as refused:
        load_uncertainty(path, RIG, RATE)
    assert "\n" not in str(refused.value) and str(path) in str(refused.value)


def test_a_fit_states_its_interval_and_timing_scales_with_the_actuator():
    k = RIG["spring.stiffness"]
    fitted = replace(RIG.quantities["spring.stiffness"], ci95=(0.96 * k, 1.03 * k))
    narrow = assumed(replace(RIG, quantities={**RIG.quantities, "spring.stiffness": fitted}), RATE)
    assert narrow.stiffness == pytest.approx(0.04) and narrow.damping == 0.5
    assert assumed(RIG, RATE).delay == 0.0 and assumed(RIG, 1000.0).delay == pytest.approx(0.96e-3, rel=0.01)
    assert assumed(RIG, RATE).mode is None


@pytest.mark.parametrize(("gains", "least", "most"), [
    (Gains(1.0, 0.0223, 12.9, 2.78, 20.3), 0.1, 0.5),  # an integral and an observer below 3 Hz: they hunt
    (Gains(1.1, 0.0307, 14.2, 0.006, 4.8), 0.0, 0.02),  # those of the design
])  # fmt: skip
def test_friction_makes_a_limit_cycle_where_the_gears_response_is_negative(gains, least, most):
    """The amplitude of the first is that of the describing function, 0.47 N m for 2 N m of friction."""
    rough = RIG.with_effect("coulomb_friction", torque=2.0)
    wanted = 5.0 * np.minimum(1.0, np.arange(2240) / 140.0)
    run = closed_loop(rough, RATE, TorqueController(RIG, RATE, gains), wanted, noise=False)
    assert least <= float(np.std(run.ft[1400:])) <= most and math.isfinite(run.command[-1])
