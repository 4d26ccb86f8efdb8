"""The pure-torque flag: right for sines on either side of the edge in time, and silent on noise."""

from __future__ import annotations

import functools
import itertools
import math

import numpy as np
import pytest

from rsea_ros.errors import ParameterError, RigError
from rsea_ros.model.observer import Observer, TorqueEstimate
from rsea_ros.model.plant import Plant
from rsea_ros.model.pure_torque import FlagSettings, PureTorque, split
from rsea_ros.model.pure_torque_filter import empty_pair, powers
from rsea_ros.model.rig import EffectSetting
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.transfer import frequency_response

SIGMA = 0.008


@functools.cache
def error_model(rate, rig):
    """Return the errors of the estimates by noise, from an observer after half a second on quiet sensors."""
    observer = Observer(load_rig(rig))
    for k in range(round(0.5 * rate)):
        observer.state(k / rate, 0.0, 0.0)
        observer.ft(k / rate, 0.0)
    return observer.error_model(1.0 / rate)


def flag_at(rate, rig="paper_high_impedance", **settings):
    """A flag that knows its noise floor."""
    flag = PureTorque(load_rig(rig), FlagSettings(**settings))
    flag.calibrate(error_model(rate, rig), 1.0 / rate)
    return flag


def feed(flag, t, torque):
    """Give the flag a torque at stamps and return its verdicts."""
    return [
        flag.take(s, TorqueEstimate(y, y, 0.0, SIGMA, SIGMA, 0.0)) for s, y in zip(t, torque, strict=True)
    ]


def sine(f, seconds, rate, phase, start=0.0):
    """Stamps and a sine of 5 N m."""
    t = np.arange(round(seconds * rate)) / rate
    return start + t, 5.0 * np.sin(2.0 * np.pi * f * t + phase)


@pytest.mark.parametrize(("rig", "rate"), [("paper_high_impedance", 280.0), ("prototype_knee", 1000.0)])
@pytest.mark.parametrize("part", [0.3, 0.95, 1.05, 1.5])
def test_a_sine_is_judged_right_within_three_periods_or_50_ms(rig, rate, part):
    """From rest and from a sine on the other side of the edge, from any phase; and the verdict stays."""
    edge = flag_at(rate, rig).edge
    f = part * edge
    latest = max(3.0 / f, 0.05)
    other = 1.4 if part < 1.0 else 0.6
    for phase, before in ((0.0, None), (1.0, other), (2.5, None), (4.0, other)):
        flag, start = flag_at(rate, rig), 0.0
        if before is not None:
            feed(flag, *sine(before * edge, 0.3, rate, 2.0 * phase))
            start = 0.3
        t, torque = sine(f, latest + 0.3, rate, phase, start)
        verdicts = feed(flag, t, torque)
        right = "pure" if part < 1.0 else "beyond"
        assert all(v == right for s, v in zip(t, verdicts, strict=True) if s - start >= latest)


def test_stamps_that_jitter_and_samples_that_are_lost_do_not_move_the_edge():
    rng = np.random.default_rng(0)
    for part, right in ((0.93, "pure"), (1.07, "beyond")):
        flag = flag_at(1000.0)
        t = np.arange(1000) / 1000.0 + 2e-4 * rng.uniform(-1.0, 1.0, 1000)
        t = np.delete(t, slice(0, None, 9))
        verdicts = feed(flag, t, 5.0 * np.sin(2.0 * np.pi * part * flag.edge * t))
        assert set(verdicts[80:]) == {right}


def test_the_edge_is_where_the_response_of_the_clamped_rig_leaves_its_tolerance():
    from rsea_ros.model.outputs import distal, proximal

    rig = load_rig("paper_high_impedance")
    f = np.linspace(1.0, 140.0, 200_000)
    ratio = frequency_response(rig, distal(rig), f) / frequency_response(rig, proximal(rig), f)
    outside = (np.abs(20.0 * np.log10(np.abs(ratio))) > 3.0) | (np.abs(np.degrees(np.angle(ratio))) > 30.0)
    flag = PureTorque(rig)
    assert flag.edge == pytest.approx(f[np.argmax(outside)], rel=1e-4)
    gain, phase = flag.error_at(40.0)
    nearest = ratio[np.argmin(np.abs(f - 40.0))]
    assert gain == pytest.approx(20.0 * np.log10(abs(nearest)), abs=1e-3)
    assert phase == pytest.approx(np.degrees(np.angle(nearest)), abs=0.01)


def test_the_readings_are_those_of_the_sine():
    flag = flag_at(280.0)
    for f in (5.0, 40.0, 57.0, 90.0):
        feed(flag, *sine(f, 0.5, 280.0, 0.3, start=f))
        reading = flag.reading()
        assert reading.occupied == pytest.approx(f, rel=0.02, abs=0.3)
    assert reading.share_above > 0.9


def test_two_sines_share_their_power():
    flag = flag_at(1000.0, window=0.2)
    t = np.arange(600) / 1000.0
    feed(flag, t, 3.0 * np.sin(2.0 * np.pi * 10.0 * t) + 4.0 * np.sin(2.0 * np.pi * 200.0 * t))
    assert flag.reading().share_above == pytest.approx(16.0 / 25.0, abs=0.02)


def test_a_smaller_share_allowed_leaves_a_sine_at_the_edge_where_it_is():
    for part, right in ((0.95, "pure"), (1.05, "beyond")):
        flag = flag_at(1000.0, limit=0.2)
        t, torque = sine(part * flag.edge, 0.4, 1000.0, 1.0)
        assert feed(flag, t, torque)[-1] == right
        assert flag.reading().share_above == pytest.approx(0.2, abs=0.05)


def test_a_slow_passage_through_the_edge_changes_the_flag_once_each_way():
    flag = flag_at(1000.0)
    t = np.arange(8000) / 1000.0
    f = flag.edge * (1.0 + 0.2 * np.sin(2.0 * np.pi * t / 8.0 - np.pi / 2.0))
    noise = 0.003 * np.random.default_rng(1).standard_normal(len(t))
    verdicts = feed(flag, t, 5.0 * np.sin(2.0 * np.pi * np.cumsum(f) / 1000.0) + noise)[100:]
    assert sum(a != b for a, b in itertools.pairwise(verdicts)) == 2


def test_after_a_torque_ceases_there_is_no_torque():
    flag = flag_at(280.0)
    feed(flag, *sine(10.0, 0.5, 280.0, 0.0))
    assert flag.verdict == "pure"
    t = 0.5 + np.arange(140) / 280.0
    verdicts = feed(flag, t, np.zeros(140))
    assert verdicts[10] == "pure" and verdicts[-1] == "no torque"
    assert math.isnan(flag.reading().occupied)


def test_sensor_noise_alone_is_no_torque_and_as_strong_as_predicted():
    rig, rate = load_rig("paper_high_impedance"), 280.0
    flag, observer, plant = flag_at(rate), Observer(rig), Plant(rig, rate, seed=11)
    pair, heard = empty_pair(), []
    for k in range(10 * 280):
        sample = plant.step(0.0)
        observer.state(k / rate, sample.position, sample.motor_torque)
        estimate = observer.ft(k / rate, sample.ft)
        assert flag.take(k / rate, estimate) == "no torque"
        heard.append(powers(pair, flag.edge, 1e-4, k / rate, estimate.distal))
    error = error_model(rate, rig.name)
    foretold = split(error.a, error.k, error.c, error.r, flag.edge, 1.0 / rate)
    assert np.mean(heard[280:], axis=0) == pytest.approx(foretold, rel=0.3)


def test_the_noise_of_white_samples_is_split_as_the_butterworth_pair_does():
    """Closed form of the mean of 1 / (1 + (tan x / g)^4): the part that passes below the corner."""
    corner, dt = 57.0, 1.0 / 280.0
    one = np.ones((1, 1))
    high, low = split(0.0 * one, one, np.ones(1), np.ones(1), corner, dt)
    g = math.tan(math.pi * corner * dt)
    assert low == pytest.approx((g**4 + (g - g**3) / math.sqrt(2.0)) / (1.0 + g**4), rel=1e-9)
    assert high + low == pytest.approx(1.0, rel=1e-9)


def test_the_band_is_that_of_the_extended_model():
    rig = load_rig("paper_high_impedance")
    soft = rig.with_effects(EffectSetting("gear_compliance", {"stiffness": 4000.0}))
    changed = rig.with_values({"gear.stiffness": 4000.0})
    assert PureTorque(soft).edge == PureTorque(changed).edge != PureTorque(rig).edge


def test_a_rig_without_a_spring_is_refused():
    with pytest.raises(RigError, match=r"rig bare_drive: spring\.rigid = True, expected a spring"):
        PureTorque(load_rig("bare_drive"))


def test_a_limit_that_is_not_a_share_is_refused():
    with pytest.raises(ParameterError, match=r"limit = 0\.9, expected a share from 0\.05 to 0\.5"):
        FlagSettings(limit=0.9)
