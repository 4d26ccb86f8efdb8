"""Whether there is a torque, deaf to noise, and how its power lies about the edge."""

import functools
import math

import numpy as np
import pytest

from rsea_ros.errors import RigError
from rsea_ros.model.observer import Observer, TorqueEstimate
from rsea_ros.model.rig import EffectSetting
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import Plant
from rsea_ros.model.torque_band import TorqueBand, empty_pair, powers, split
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


def band_at(rate, rig="paper_high_impedance"):
    """A band that knows its noise floor."""
    band = TorqueBand(load_rig(rig))
    band.calibrate(error_model(rate, rig), 1.0 / rate)
    return band


def feed(band, t, torque):
    """Give a torque at stamps and return whether it is heard."""
    return [
        band.take(s, TorqueEstimate(y, y, 0.0, SIGMA, SIGMA, 0.0)) for s, y in zip(t, torque, strict=True)
    ]


def sine(f, seconds, rate, phase, start=0.0):
    """Stamps and a sine of 5 N m."""
    t = np.arange(round(seconds * rate)) / rate
    return start + t, 5.0 * np.sin(2.0 * np.pi * f * t + phase)


def test_the_edge_is_where_the_response_of_the_clamped_rig_leaves_its_tolerance():
    from rsea_ros.model.outputs import distal, proximal

    rig = load_rig("paper_high_impedance")
    f = np.linspace(1.0, 140.0, 200_000)
    ratio = frequency_response(rig, distal(rig), f) / frequency_response(rig, proximal(rig), f)
    outside = (np.abs(20.0 * np.log10(np.abs(ratio))) > 3.0) | (np.abs(np.degrees(np.angle(ratio))) > 30.0)
    band = TorqueBand(rig)
    assert band.edge == pytest.approx(f[np.argmax(outside)], rel=1e-4)
    gain, phase = band.error_at(40.0)
    nearest = ratio[np.argmin(np.abs(f - 40.0))]
    assert gain == pytest.approx(20.0 * np.log10(abs(nearest)), abs=1e-3)
    assert phase == pytest.approx(np.degrees(np.angle(nearest)), abs=0.01)


def test_the_readings_are_those_of_the_sine():
    band = band_at(280.0)
    for f in (5.0, 40.0, 57.0, 90.0):
        feed(band, *sine(f, 0.5, 280.0, 0.3, start=f))
        occupied = band.occupied()
        assert occupied.hz == pytest.approx(f, rel=0.02, abs=0.3)
    assert occupied.share_above > 0.9


def test_two_sines_share_their_power():
    pair, t = empty_pair(), np.arange(600) / 1000.0
    torque = 3.0 * np.sin(2.0 * np.pi * 10.0 * t) + 4.0 * np.sin(2.0 * np.pi * 200.0 * t)
    for sample in zip(t, torque, strict=True):
        above, below = powers(pair, 57.0, *sample, 0.2)
    assert above / (above + below) == pytest.approx(16.0 / 25.0, abs=0.02)


def test_after_a_torque_ceases_there_is_no_torque():
    band = band_at(280.0)
    assert feed(band, *sine(10.0, 0.5, 280.0, 0.0))[-1]
    t = 0.5 + np.arange(140) / 280.0
    heard = feed(band, t, np.zeros(140))
    assert heard[10] and not heard[-1]
    assert math.isnan(band.occupied().hz)


def test_sensor_noise_alone_is_no_torque_and_as_strong_as_predicted():
    rig, rate = load_rig("paper_high_impedance"), 280.0
    band, observer, plant = band_at(rate), Observer(rig), Plant(rig, rate, seed=11)
    pair, heard = empty_pair(), []
    for k in range(10 * 280):
        sample = plant.step(0.0)
        observer.state(k / rate, sample.position, sample.motor_torque)
        estimate = observer.ft(k / rate, sample.ft)
        assert not band.take(k / rate, estimate)
        heard.append(powers(pair, band.edge, k / rate, estimate.distal, 1e-4))
    error = observer.error_model(1.0 / rate)
    foretold = split(error.a, error.k, error.c, error.r, band.edge, 1.0 / rate)
    assert np.mean(heard[280:], axis=0) == pytest.approx(foretold, rel=0.3)


def test_one_wrong_reading_of_ft_is_not_believed():
    """Noise beyond 4 sigma, once a minute, passed for a torque that the model lacks: 94 false alarms."""
    rig, rate = load_rig("paper_high_impedance"), 280.0
    observer, plant = Observer(rig), Plant(rig, rate, seed=12)
    for k in range(2000):
        sample = plant.step(0.0)
        observer.state(k / rate, sample.position, sample.motor_torque)
        wrong = 5.0 * rig.sensors["ft"].noise if k == 1500 else 0.0
        estimate = observer.ft(k / rate, sample.ft + wrong)
        assert k < 280 or abs(estimate.distal) < rig.sensors["ft"].noise


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
    assert TorqueBand(soft).edge == TorqueBand(changed).edge != TorqueBand(rig).edge


def test_a_rig_without_a_spring_is_refused():
    with pytest.raises(RigError, match=r"rig bare_drive: spring\.rigid = True, expected a spring"):
        TorqueBand(load_rig("bare_drive"))
