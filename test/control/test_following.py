"""How torque follows sines: its phase, continuous from where it is followed."""

import math
from dataclasses import replace

import numpy as np
import pytest

from rsea_ros.control import following
from rsea_ros.control.following import ControlTrace, Following, fall
from rsea_ros.report.figures.figure import AFTER
from rsea_ros.report.figures.response import ResponseCurve, response_figure
from test.control.benches import DESIGN, RIG

HZ = np.array([1.0, 2.0, 5.0, 10.0, 20.0, 50.0])
FOLLOWED = np.array([1.0, 1.0, 0.7, 0.2]) * np.exp(-1j * np.radians([0.0, 5.0, 100.0, 200.0]))


def curve(*unheard):
    """Return a response that is followed from 5 Hz on; below, only the phases (deg) of its remains differ."""
    remains = 0.02 * np.exp(1j * np.radians(unheard))
    return Following(HZ, np.concatenate([remains, FOLLOWED]), np.ones(len(HZ)))


@pytest.mark.parametrize("unheard", [(-100.0, -30.0), (170.0, -170.0), (60.0, -150.0), (-150.0, -175.0)])
def test_the_phase_of_what_is_followed_does_not_hang_on_what_is_not(unheard):
    """At 1 kHz the plot of the free load stood 360 degrees below that at 280 Hz."""
    phase = curve(*unheard).phase
    assert phase[2:] == pytest.approx([0.0, -5.0, -100.0, -200.0])
    assert phase[:2] == pytest.approx(unheard)


def test_a_plot_shows_the_phase_that_it_is_given():
    shown = curve(170.0, -170.0)
    drawn = response_figure("", [ResponseCurve("", AFTER, HZ, shown.torque, phase=shown.phase)]).data
    assert drawn[-1]["y"] == pytest.approx(shown.phase, abs=1e-3)


@pytest.mark.parametrize(
    ("gain", "hz"),
    [((0.0, -2.0, -4.0), math.sqrt(200.0)), ((0.0, -3.0, -3.1), 10.0), ((0.0, 1.0, -3.0), math.inf),
     ((-4.0, -5.0, -6.0), 0.0), ((0.0, -5.0, 1.0), 10.0**0.6), ((-4.0, 0.0, -6.0), 10.0 * 2.0**0.5)],
)  # fmt: skip
def test_a_band_ends_where_the_gain_first_falls_below_three_decibels(gain, hz):
    assert fall(np.array([1.0, 10.0, 20.0]), np.array(gain)) == pytest.approx(hz)


def test_the_error_of_a_run_is_that_behind_its_settling():
    t, wanted = np.arange(4.0), np.array([9.0, 3.0, 4.0, 0.0])
    run = ControlTrace(t, wanted, np.array([0.0, 3.5, 4.0, 0.5]), np.array([1.0, -7.0, 0.0, 0.0]), t)
    assert run.error(1.0) == pytest.approx(math.sqrt(0.5 / 25.0))
    assert run.error() == pytest.approx(math.sqrt(81.5 / 106.0))
    assert str(run) == "ControlTrace(4 samples, 3 s, at most 7 N·m)"


RATE = 500.0
AT_500 = replace(DESIGN, rate=RATE)


def played(monkeypatch, answer):
    """Let the loop answer a desired torque by a function of times and values, instead of a machine."""

    def loop(rig, rate, controller, desired, *, noise, late):
        assert not noise and late == 2 and controller.rate == rate == RATE
        t = np.arange(len(desired)) / rate
        return ControlTrace(t, desired, answer(t, desired), 3.0 * desired, 0.0 * t)

    monkeypatch.setattr(following, "closed_loop", loop)


def test_a_step_has_the_rise_and_the_settling_of_its_exponential(monkeypatch):
    """From 10 to 90 % a first order takes ln 9 of its time constants, into 5 % ln 20; 5 N m at 0.3 s."""
    for over, lag in ((0.0, 0.05), (0.2, 0.1)):
        def answer(t, desired, over=over, lag=lag):
            since = np.maximum(t - 0.3, 0.0)
            assert np.array_equal(desired, np.where(t < 0.3 - 1e-9, 0.0, 5.0)) and len(t) == 750
            return 5.0 * (1.0 - (1.0 - 5.0 * over * since / lag) * np.exp(-since / lag))

        played(monkeypatch, answer)
        step = following.step_response(RIG, RIG, AT_500, late=2)
        assert step.t[0] == 0.0 and len(step.t) == 600 and step.ft[-1] == pytest.approx(5.0, rel=1e-3)
        if not over:
            assert step.rise == pytest.approx(lag * math.log(9.0), abs=2.0 / RATE) and step.overshoot < 1e-9
            assert step.settling == pytest.approx(lag * math.log(20.0), abs=1.5 / RATE)
        else:  # the excess is (u - 1) e^-u, largest at u = 2
            assert step.overshoot == pytest.approx(math.exp(-2.0), rel=1e-3)
            outside = 0.05 - (np.arange(1.0, 9.0, 1e-4) - 1.0) * np.exp(-np.arange(1.0, 9.0, 1e-4))
            last = np.arange(1.0, 9.0, 1e-4)[np.nonzero(outside < 0.0)[0][-1]]
            assert step.settling == pytest.approx(lag * last, abs=1.5 / RATE)


def test_sines_that_come_three_samples_late_have_that_phase_and_gain(monkeypatch):
    def answer(t, desired):
        late = 0.8 * np.concatenate([np.zeros(3), desired[:-3]])
        return np.where(t < 0.7 - 1e-9, 1e3, late)

    played(monkeypatch, answer)
    shown = following.follow(RIG, RIG, AT_500, late=2)
    assert shown.hz.tolist() == [1, 2, 3, 5, 10, 15, 20, 27, 35, 50, 70, 120, 200], "up to 0.46 of the rate"
    expected = 0.8 * np.exp(-2j * np.pi * shown.hz * 3.0 / RATE)
    np.testing.assert_allclose(shown.torque, expected, atol=0.04)
    np.testing.assert_allclose(shown.motor, 3.0, rtol=1e-9)
    assert shown.peak == pytest.approx(20.0 * math.log10(0.8), abs=0.4) and shown.bandwidth == math.inf
    assert shown.motor_at(7.0) == pytest.approx(3.0)
    assert curve(0.0, 0.0).gain_at(np.array([math.sqrt(200.0)])) == pytest.approx(10.0 * math.log10(0.7))
