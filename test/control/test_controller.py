"""The controller on the simulated bench: following, compensations, limits, lost and late samples."""

import math
from dataclasses import replace

import numpy as np
import pytest

from bench.control.human import prediction_response
from rsea_ros.control.compensation import compensation
from rsea_ros.control.controller import ControllerSettings, Measurement, TorqueController, TorqueLimits
from rsea_ros.control.following import closed_loop, follow
from rsea_ros.control.grid import Lateness
from rsea_ros.control.law import Gains, sample_rig
from rsea_ros.control.prediction import AHEAD, Prediction
from rsea_ros.control.reference import inverse, inverse_poles
from rsea_ros.control.study import EFFECTS, Span, sine, tracking_error
from rsea_ros.control.synthesis import ControllerDesign
from rsea_ros.control.uncertainty import BenchVariant, load_range
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import Plant

RATE = 280.0
GAINS = Gains(0.2575, 0.003029, 1.195, 6.99, 42.9)
RIG, FREE = load_rig("paper_high_impedance"), load_rig("paper_moving_output")
DESIGN = ControllerDesign(GAINS, RATE, {}, math.nan)
TIMING = ("trust", "offset", "desired_offset")


def test_a_sine_is_followed_without_knowing_the_load():
    assert sine(RIG, RIG, DESIGN) < 0.02
    assert sine(FREE, RIG, DESIGN, 4.6) < 0.03


def test_a_limited_slew_leaves_the_torque_of_the_model_alone():
    """At 1 kHz the limited slew disturbed the model under a command that moves a free load: 150 % off."""
    gains = Gains(0.2446, 0.00087, 0.612, 29.97, 53.6)
    design = ControllerDesign(gains, 1000.0, {}, math.nan)
    assert sine(FREE, RIG, design, 4.6, span=Span(1.6, 1.2)) < 0.03


@pytest.mark.parametrize("load", ["locked", "free x 1"])
def test_a_late_path_costs_nothing_once_it_is_learned(load):
    """A sample and 2 ms: 8 to 10 % off, because the observer took the learned lead for a disturbance."""
    loads = load_range(RIG, FREE)
    assert tracking_error(RIG, loads, BenchVariant(load, 1.1, 1.5, 1, 2e-3), DESIGN) < 0.03


def test_a_slow_sine_is_followed_on_an_unknown_pendulum():
    """Its weight outweighs the inertia: at 2 Hz that was 34 % off, because theta_1 could not be negative."""
    load = FREE.with_values({"housing_end.inertia": 2.0 * FREE["housing_end.inertia"]})
    assert sine(load, RIG, DESIGN, 2.8, 2.0, span=Span(4.0, 2.5)) < 0.05


@pytest.mark.parametrize(("hz", "amplitude"), [(4.0, 0.5), (3.0, 1.0)])
def test_small_motion_teaches_no_load_that_is_not_there(hz, amplitude):
    """Samples above a limit were those with the most noise: held at both ends, half a N m was 52 % off."""
    wanted = amplitude * np.sin(2.0 * np.pi * hz * np.arange(560) / RATE)
    errors = []
    for learn in (True, False):
        controller = TorqueController(RIG, RATE, GAINS, settings=ControllerSettings(learn=learn))
        errors.append(closed_loop(RIG, RATE, controller, wanted).error(1.0))
    assert errors[0] < 1.5 * errors[1]


def test_small_sines_come_out_as_predicted():
    """No frequency is amplified beyond 1.5 dB: an extrapolator alone reached 18.7 dB at half the rate."""
    response = follow(RIG, RIG, DESIGN)
    decibel = 20.0 * np.log10(np.abs(response.torque))
    assert decibel.max() < 1.5 and np.abs(decibel[response.hz < 8.0]).max() < 0.1
    assert response.bandwidth > 3.0 * 6.365
    wanted = prediction_response(80.0, 1.0 / RATE, response.hz)
    below = response.hz < 6.0
    assert response.torque[below] == pytest.approx(wanted[below], rel=0.02)


def sender(shape, rng):
    """Return for each sample the newest desired torque's instant, in samples."""
    at, due = np.arange(4 * int(RATE)), np.arange(-2.0, 4 * RATE + 2.0) + 0.2
    if shape == "jitter":
        due = due + rng.uniform(-0.3, 0.3, len(due))
    elif shape == "pauses":
        due = due[(np.arange(len(due)) % 90 > 2)]
    elif shape == "late":
        due = due - 0.6 + rng.uniform(-0.3, 0.3, len(due))
    return due[np.searchsorted(due, at + 0.5) - 1] - at


@pytest.mark.parametrize(("shape", "most"), [("jitter", 14.0), ("pauses", 30.0), ("late", 14.0)])
def test_a_sender_that_is_not_in_time_is_not_answered_by_the_motor(shape, most):
    """A jitter of 0.36 ms, as of every program that sleeps, was 65 N m at the motor for 10 N m at 5 Hz."""
    plant, controller, torque = Plant(RIG, RATE), TorqueController(RIG, RATE, GAINS), 0.0
    torques, errors = [], []
    for k, off in enumerate(sender(shape, np.random.default_rng(3))):
        sample = plant.step(torque)
        wish = 10.0 * math.sin(2.0 * math.pi * 5.0 * (k + off) / RATE)
        torque = controller.step(_reading(sample), wish, desired_offset=off)
        torques.append(torque)
        errors.append(sample.ft - 10.0 * math.sin(2.0 * math.pi * 5.0 * k / RATE))
    assert np.abs(torques[140:]).max() < most
    assert np.abs(errors[140:]).max() < 1.0


def test_a_desired_torque_that_is_not_renewed_comes_to_rest_near_its_last_value():
    prediction = Prediction(80.0, 1.0 / RATE)
    for k in range(40):
        prediction.ahead(0.5 * k, 2)
    path = [prediction.ahead(19.5, 2, -1.0 - k)[0] for k in range(40)]
    assert np.all(np.diff(path) >= -1e-9) and 19.5 < path[-1] < 19.5 + 0.5 * (AHEAD + 2 + 3)
    assert path[-1] == pytest.approx(path[-10], abs=1e-3)


def test_what_is_done_with_a_course_does_not_reach_back_into_its_low_pass():
    """The state was a view into the course: the bandwidth of a sine went from 26 to 31 Hz."""
    calm, disturbed = Prediction(80.0, 1.0 / RATE), Prediction(80.0, 1.0 / RATE)
    for k in range(30):
        wish = math.sin(0.6 * k)
        calm.ahead(wish, 2)
        disturbed.ahead(wish, 2)[:] = 99.0
    assert calm.ahead(1.0, 2) == pytest.approx(disturbed.ahead(1.0, 2))
    first = second = 0.0
    smooth, soft = Prediction(80.0, 1.0 / RATE), 1.0 - math.exp(-2.0 * math.pi * 40.0 / RATE)
    for k in range(30):
        smooth.ahead(math.sin(0.6 * k), 2)
        first += soft * (math.sin(0.6 * k) - first)
        second += soft * (first - second)
    assert smooth._smooth == pytest.approx([first, second])


def test_a_jump_is_not_extrapolated():
    prediction = Prediction(80.0, 1.0 / RATE)
    jump = [prediction.ahead(0.0 if k < 5 else 1.0, 1)[0] for k in range(60)]
    assert max(jump) < 1.05 and jump[-1] == pytest.approx(1.0, abs=1e-3)


def test_missed_samples_are_bridged_without_a_kink():
    """After two lost samples of a sine of 5 Hz the prediction is as good as before."""
    prediction, errors = Prediction(80.0, 1.0 / RATE), []
    r = lambda k: math.sin(2.0 * math.pi * 5.0 * k / RATE)  # noqa: E731
    for k in range(200):
        if k in (100, 101):
            continue
        for between in prediction.between(r(k), 2 if k == 102 else 0):
            prediction.ahead(float(between), 1)
        errors.append(abs(prediction.ahead(r(k), 1)[0] - r(k + AHEAD)))
    assert max(errors[50:]) < 2.0 * max(errors[50:99])


def test_a_parabola_is_predicted():
    prediction, k = Prediction(80.0, 1.0 / RATE), np.arange(200)
    torque = 3.0 + 0.2 * k - 0.01 * k**2
    ahead = [prediction.ahead(float(t), 1)[0] for t in torque]
    assert ahead[-20:-AHEAD] == pytest.approx(torque[-20 + AHEAD :], rel=1e-9)


@pytest.mark.parametrize("name", ["paper_high_impedance", "paper_moving_output", "prototype_knee"])
@pytest.mark.parametrize("rate", [280.0, 1000.0])
def test_the_inverse_leads_the_model_to_the_desired_torque(name, rate):
    """Slow torques are exact, also where a single sample cannot be inverted."""
    f = inverse(sample_rig(load_rig(name), rate))
    assert np.abs(inverse_poles(f)).max() < 1.0 + 1e-6
    x = np.zeros(len(f.plant.a))
    for k in range(400):
        wanted = np.sin(0.02 * (k + 1 + np.arange(f.moves)))
        x = f.plant.a @ x + f.plant.b * f.torque(x, wanted)
    assert f.plant.c[0] @ x == pytest.approx(wanted[0], abs=0.02)


def test_compensations_are_the_means_of_what_they_cancel():
    known = compensation(RIG.with_effects(EFFECTS[1], EFFECTS[2], EFFECTS[3]))
    w = np.linspace(-0.02, 0.03, 20001)
    size = 1.5 + 2.0 * math.exp(-((0.005 / 0.05) ** 2))
    assert known.friction(-0.02, 0.03) == pytest.approx(np.mean(size * np.tanh(w / 2e-3)), rel=1e-3)
    q = np.linspace(0.001, 0.0018, 20001)
    ripple = -3.0 * np.sin(4.0 * 502.0 * q + 0.7)
    assert known.ripple(0.001, 0.0018) == pytest.approx(np.mean(ripple), rel=1e-3)
    assert known.way(100.0) - known.way(-100.0) == pytest.approx(EFFECTS[3].parameters["gap"])


def test_a_torque_beyond_the_limit_causes_no_windup():
    """After a second of 200 N m requested with a limit of 30 N m, 5 N m are reached within 0.15 s."""
    wanted = np.concatenate([np.full(280, 200.0), np.full(200, 5.0)])
    controller = TorqueController(RIG, RATE, GAINS, limits=TorqueLimits(torque=30.0))
    trace = closed_loop(RIG, RATE, controller, wanted)
    assert np.abs(trace.command).max() == pytest.approx(30.0)
    assert trace.ft[150:280] == pytest.approx(30.0, abs=0.5)
    assert trace.ft[280 + 42 :] == pytest.approx(5.0, abs=0.5)


def test_it_takes_over_from_another_command_without_a_jump():
    plant = Plant(RIG, RATE)
    for _ in range(600):
        sample = plant.step(20.0)
    controller, torque, ft, torques = TorqueController(RIG, RATE, GAINS), 20.0, [], [20.0]
    controller.start(_reading(sample), 20.0)
    for _ in range(200):
        torques.append(controller.step(_reading(sample), 20.0))
        sample = plant.step(torque)
        torque = torques[-1]
        ft.append(sample.ft)
    assert np.abs(np.diff(torques)).max() < 2.0
    assert np.array(ft) == pytest.approx(20.0, abs=0.3)


def test_the_torque_grows_slowly_where_something_else_loads_the_spring():
    loaded = Measurement(20.0, 0.0, 20.0 / 1530.456, 0.0)
    controller = TorqueController(RIG, RATE, GAINS, limits=TorqueLimits(torque=68.0, ramp=0.25))
    controller.start(loaded, 50.0)
    torques = [abs(controller.step(loaded, 50.0)) for _ in range(70)]
    assert np.all(np.array(torques) <= 68.0 / 0.25 / RATE * np.arange(1, 71) + 1e-9)


@pytest.mark.parametrize("known", [True, False], ids=["torque measured", "torque unknown"])
def test_lost_and_late_samples_do_no_harm(known):
    """Two samples lost, and all commands of 30 ms late, in the middle of a sine through friction."""
    plant, controller = Plant(RIG.with_effects(EFFECTS[0]), RATE), TorqueController(RIG, RATE, GAINS)
    acting, pending, lost, errors = 0.0, 0.0, 0, []
    sample = plant.step(0.0)
    for k in range(700):
        wanted = 10.0 * math.sin(2.0 * math.pi * 5.0 * k / RATE)
        errors.append(sample.ft - wanted)
        if k in (300, 301):
            lost += 1
        else:
            reading = _reading(sample) if known else Measurement(sample.ft, sample.velocity, sample.position)
            command, lost = controller.step(reading, wanted, lost), 0
        sample = plant.step(acting)
        acting = acting if 450 <= k < 458 else pending
        acting, pending = (acting, command)
    quiet, disturbed = np.array(errors[200:300]), np.array(errors[300:])
    assert np.abs(disturbed).max() < 6.0
    assert np.std(disturbed[-100:]) < 1.2 * np.std(quiet) < 0.2


def test_commands_that_come_far_too_late_are_feed_forward_alone_and_stay_stable():
    """Six samples late at 1 kHz: feedback would diverge, feed-forward is late by 6 ms at 5 Hz, 19 %."""
    gains = Gains(0.2446, 0.00087, 0.612, 29.97, 53.6)
    plant, controller = Plant(RIG, 1000.0), TorqueController(RIG, 1000.0, gains)
    acting, errors, sample = [0.0] * 8, [], plant.step(0.0)
    for k in range(2000):
        wanted = 10.0 * math.sin(2.0 * math.pi * 5.0 * k / 1000.0)
        errors.append(sample.ft - wanted)
        acting.append(controller.step(_reading(sample), wanted, trust=0.0))
        sample = plant.step(acting.pop(0))
    assert np.sqrt(2.0) * np.std(errors[1000:]) / 10.0 < 0.3


def _reading(sample):
    return Measurement(sample.ft, sample.velocity, sample.position, sample.motor_torque)


@pytest.mark.parametrize("lost", [0.05, 0.2, 0.4])
def test_a_restart_under_a_desired_torque_lets_the_error_in_slowly(lost):
    """10 N m at once took 47 N m of the motor; with lost samples a load was learned that was not there."""
    for seed in range(2):
        plant, controller = Plant(RIG, RATE, seed=seed), TorqueController(RIG, RATE, GAINS)
        dice, acting, pending, missed, torques = np.random.default_rng(seed), 0.0, 0.0, 0, []
        lateness, sample = Lateness(RATE), plant.step(0.0)
        controller.start(_reading(sample), 10.0)
        for _ in range(350):
            if dice.random() < lost:
                missed += 1
            else:
                trust = lateness.take(float(missed), max(1, missed + 1))
                pending, missed = controller.step(_reading(sample), 10.0, missed, trust=trust), 0
            sample, acting = plant.step(acting), pending
            torques.append(abs(acting))
        assert max(torques) < 13.0
        assert sample.ft == pytest.approx(10.0, abs=1.5)


@pytest.mark.parametrize("bad", [math.nan, 1e300, -1e4])
@pytest.mark.parametrize("name", ["ft", "velocity", "position", "motor_torque", "ft_age", "desired", *TIMING])
def test_one_value_that_is_no_measurement_is_a_lost_sample(name, bad):
    """One ft of 1e300 was full torque for 20 samples, one NaN a torque of NaN for ever."""
    large = math.inf if name in TIMING else 1e6 if name in ("velocity", "position", "ft_age") else 0.0
    if abs(bad) < large:
        return  # finite, and of some actuator
    plant, controller, torque, torques = Plant(RIG, RATE), TorqueController(RIG, RATE, GAINS), 0.0, []
    for k in range(400):
        reading, desired = _reading(plant.step(torque)), 10.0 * math.sin(2.0 * math.pi * k / RATE)
        if k == 250 and name == "desired":
            desired = bad
        elif k == 250 and name not in TIMING:
            reading = replace(reading, **{name: bad})
        torque = controller.step(reading, desired, **({name: bad} if k == 250 and name in TIMING else {}))
        torques.append(torque)
    assert np.isfinite(torques).all() and np.abs(torques).max() < 16.0


def test_readings_that_stay_unusable_end_the_torque_and_the_next_begins_anew():
    plant, controller, torque = Plant(RIG, RATE), TorqueController(RIG, RATE, GAINS), 0.0
    for k in range(300):
        reading = _reading(plant.step(torque))
        torque = controller.step(replace(reading, ft=math.nan) if 100 <= k < 130 else reading, 10.0)
        if 115 <= k < 130:
            assert torque == 0.0
    assert torque == pytest.approx(10.0, abs=1.0)


@pytest.mark.parametrize("bench", [RIG, FREE])
def test_an_encoder_alone_serves(bench):
    """Without a velocity it is that of the last three positions, without a lag."""
    plant = Plant(bench, RATE)
    controller = TorqueController(RIG, RATE, GAINS, settings=ControllerSettings(velocity=False))
    sample, pending, off, amplitude = plant.step(0.0), 0.0, [], 4.2
    for k in range(1120):
        t = k / RATE
        wanted = amplitude * min(1.0, 4.0 * t) ** 2 * math.sin(2.0 * math.pi * 5.0 * t)
        off.append(sample.ft - wanted)
        command = controller.step(Measurement(sample.ft, math.nan, sample.position), wanted)
        sample, pending = plant.step(pending), command
    assert np.sqrt(2.0 * np.mean(np.square(off[840:]))) < 0.03 * amplitude
