"""Measured responses and their doubt against the equations of motion: no bias from hold or stamps."""

import numpy as np
import pytest
from runs import RATE, RIG, command_of, excited

from rsea_ros.errors import ChannelError, IdentificationError
from rsea_ros.identification.frequency_response import (
    estimate_response,
    find_periods,
    responses_of,
    sampled_integrators,
)
from rsea_ros.identification.local_polynomial import AtRestError
from rsea_ros.model import outputs
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import simulate, synthesize
from rsea_ros.model.transfer import frequency_response
from rsea_ros.records.record import Channel, Record


def sampled_at(rig, command, stamps):
    """Return a noise-free record whose sensors were read at `stamps`."""
    names = ("ft", "position", "velocity")
    asked = Record({"command": command, **{n: Channel(stamps, 0.0 * stamps) for n in names}})
    return asked.with_channels(**{n: Channel(stamps, y) for n, y in simulate(rig, asked).items()})


def truth(rig, name, hz):
    output = outputs.end_torque(rig, rig.ft_end) if name == "ft" else outputs.position()
    response = frequency_response(rig, output, hz)
    return response * 2j * np.pi * hz if name == "velocity" else response


def is_true(rig, r, low=1.0):
    """Whether a response is within 1 % and 1 degree of that of the equations up to 100 Hz."""
    inside = (r.frequency >= low) & (r.frequency <= 100.0)
    quotient = (r.response / truth(rig, r.output, r.frequency))[inside]
    gain, phase = np.abs(np.abs(quotient) - 1.0), np.abs(np.angle(quotient, deg=True))
    return gain.max() < 0.01 and phase.max() < 1.0


def quiet(rig, kind, duration):
    """Return the record of a rig with perfect sensors."""
    return synthesize(rig, command_of(kind, duration=duration), noise=False)


MOVING = load_rig("paper_moving_output")


@pytest.mark.parametrize(
    ("rig", "kind", "name", "duration", "method"),
    [(RIG, "white_noise", "ft", 160.0, "Welch"), (RIG, "white_noise", "velocity", 160.0, "Welch"),
     (RIG, "chirp", "ft", 160.0, "local polynomial"), (RIG, "multisine", "position", 60.0, "multisine"),
     (MOVING, "chirp", "ft", 160.0, "local polynomial")],
)  # fmt: skip
def test_noise_free_record_gives_the_transfer_function(rig, kind, name, duration, method):
    """Also where the pendulum of a moving output takes the torque away."""
    response = estimate_response(quiet(rig, kind, duration), name)
    assert response.method == method
    assert is_true(rig, response)


def test_delay_of_the_command_is_seen_as_phase():
    late = RIG.with_effect("command_delay", delay=1.5 / RATE)
    response = estimate_response(quiet(late, "multisine", 60.0), "position")
    lag = np.exp(-2j * np.pi * response.frequency * 1.5 / RATE)
    quotient = response.response / truth(RIG, "position", response.frequency) / lag
    inside = response.frequency < 100.0
    assert float(np.max(np.abs(quotient[inside] - 1.0))) < 0.01


def test_jitter_and_missing_samples_leave_no_bias():
    command = command_of("multisine", duration=60.0)
    rng = np.random.default_rng(7)
    stamps = command.t + (1.0 + 0.05 * rng.standard_normal(len(command))) / RATE
    response = estimate_response(sampled_at(RIG, command, stamps[rng.random(len(stamps)) > 0.002]), "ft")
    error = response.response / truth(RIG, "ft", response.frequency) - 1.0
    inside = (response.frequency > 1.0) & (response.frequency < 100.0)
    assert abs(error[inside].mean()) < 0.003
    assert np.mean(np.abs(response.sd / np.abs(response.response))[inside]) < 0.02


def test_a_sensor_faster_than_the_command_leaves_no_bias():
    command = command_of("chirp", duration=60.0)
    stamps = np.arange(round(command.t[-1] * 1000.0)) / 1000.0
    assert is_true(RIG, estimate_response(sampled_at(RIG, command, stamps), "velocity"), low=2.0)


def test_a_missing_channel_and_a_short_record_are_named():
    record = excited(load_rig("bare_drive"), duration=15.0)
    with pytest.raises(ChannelError, match="no channel 'ft'"):
        estimate_response(record, "ft")
    with pytest.raises(IdentificationError, match="usable samples, expected at least 32"):
        estimate_response(record.between(0.0, 0.05), "position")


def test_a_stretch_at_rest_shows_no_response():
    """A frozen encoder left only a stretch without a command: 0 over 0, and no eigenvalue converged."""
    t = np.arange(1200) / 280.0
    pulse = np.where(t > 3.0, 20.0 * np.sin(50.0 * t), 0.0)
    sensor = Channel(t, np.where(t > 2.5, np.nan, 0.01 * np.sin(t)))
    record = Record({"command": Channel(t, pulse), "position": sensor})
    with pytest.raises(AtRestError, match="position: the command never changes where all is measured"):
        estimate_response(record, "position")
    assert responses_of(record, RIG) == ()


@pytest.mark.parametrize("frequency", [10.0, 20.0])
def test_a_sensor_too_slow_for_the_only_line_of_a_command_shows_no_response(frequency):
    t = np.arange(1400) / RATE
    rig = load_rig("bare_drive")
    fast = synthesize(rig, Channel(t, 5.0 * np.sin(2.0 * np.pi * frequency * t)))
    slow = np.arange(0.0, 5.0, 1.0 / 14.0)
    record = fast.with_channels(position=Channel(slow, np.interp(slow, t, fast["position"].y)))
    assert responses_of(record, rig) == ()


@pytest.mark.parametrize("offset", [0.0, 0.3, -0.4, -1.7])
def test_closed_form_is_the_sum_over_images(offset):
    x, k = np.array([0.05, 0.3, 0.44]), np.arange(-20000, 20001)
    at = x[:, None] + k
    hold = np.sinc(at) * np.exp(-1j * np.pi * at)
    turned = hold * np.exp(2j * np.pi * k * offset)
    images = np.array([np.sum(turned / (2j * np.pi * at) ** p, axis=1) for p in (1, 2, 3, 4)])
    assert sampled_integrators(x, offset) == pytest.approx(images, rel=2e-5)


def test_a_slow_command_repeats_with_its_period_and_not_at_every_sample():
    """Targets at tens of Hz move less than the tolerance from one to the next."""
    t = np.arange(1246) / 50.0
    assert find_periods(0.5 + 0.15 * np.cos(2 * np.pi * 0.05 * t)) is None
    periods = find_periods(0.5 + 0.15 * np.cos(2 * np.pi * 0.15 * t))
    assert (periods.length, periods.count) == (333, 3)


CIRCLE = np.sqrt(-np.log(0.05))


def noisy(kind, duration, seed, level):
    """Return a record without noise, and with white noise of `level` N m on its F/T sensor."""
    clean = synthesize(RIG, command_of(kind, duration=duration, seed=seed), noise=False)
    noise = level * np.random.default_rng([seed, 99]).standard_normal(len(clean["ft"]))
    return clean, clean.with_channels(ft=Channel(clean["ft"].t, clean["ft"].y + noise))


@pytest.mark.parametrize("kind", ["white_noise", "chirp", "multisine"])
def test_circles_contain_the_truth(kind):
    inside, count = 0, 0
    for seed in range(4):
        clean, record = noisy(kind, 40.0, seed, level=0.5)
        truth, measured = estimate_response(clean, "ft"), estimate_response(record, "ft")
        within = np.abs(measured.response - truth.response) < CIRCLE * measured.sd
        band = measured.frequency < 100.0
        inside, count = inside + int(np.sum(within[band])), count + int(np.sum(band))
    assert 0.93 < inside / count < 0.975


def test_coherence_falls_with_noise():
    _, quiet = noisy("white_noise", 80.0, 1, level=0.01)
    _, loud = noisy("white_noise", 80.0, 1, level=2.0)
    high = [float(np.mean(estimate_response(r, "ft").coherence[-200:])) for r in (quiet, loud)]
    assert high[0] > 0.99
    assert high[1] < 0.5


@pytest.mark.parametrize(("effect", "distorts"), [("nonlinear_spring", True), (None, False)])
def test_distortion_is_distinguished_from_noise(effect, distorts):
    rig = RIG.with_effect(effect, cubic=2000.0) if effect else RIG
    record = excited(rig, "multisine", sensors=5, duration=60.0, amplitude=20.0, high=60.0)
    measured = estimate_response(record, "ft")
    low = measured.frequency < 12.0
    assert measured.distortion is not None and measured.noise is not None
    ratio = float(np.sqrt(np.mean(measured.distortion[low] ** 2) / np.mean(measured.noise[low] ** 2)))
    assert (ratio > 5.0) is distorts
    assert (ratio < 1.0) is not distorts
