"""Measured responses and their doubt against the equations of motion: no bias from hold or stamps."""

from __future__ import annotations

import numpy as np
import pytest

from rsea_ros.errors import ChannelError, IdentificationError
from rsea_ros.identification.excitation import ExcitationSettings, excitation
from rsea_ros.identification.frequency_response import (
    estimate_response,
    find_periods,
    responses_of,
    sampled_integrators,
)
from rsea_ros.identification.local_polynomial import AtRestError
from rsea_ros.identification.result import ComplexArray, FrequencyResponse
from rsea_ros.model import outputs
from rsea_ros.model.rig import EffectSetting, Rig
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import simulate, synthesize
from rsea_ros.model.transfer import frequency_response
from rsea_ros.records.record import Channel, FloatArray, Record

RATE = 280.0
SENSORS = ("ft", "position", "velocity")
KINDS = {
    "white_noise": (160.0, "Welch"),
    "chirp": (160.0, "local polynomial"),
    "multisine": (60.0, "multisine"),
}


def command_of(kind: str, duration: float, seed: int = 0) -> Channel:
    u = excitation(kind, ExcitationSettings(rate=RATE, duration=duration, seed=seed))
    return Channel(np.arange(len(u)) / RATE, u)


def sampled_at(rig: Rig, command: Channel, stamps: FloatArray) -> Record:
    """Return a noise-free record whose sensors were read at `stamps`."""
    asked = Record({"command": command, **{n: Channel(stamps, np.zeros(len(stamps))) for n in SENSORS}})
    return asked.with_channels(**{n: Channel(stamps, y) for n, y in simulate(rig, asked).items()})


def truth(rig: Rig, name: str, hz: FloatArray) -> ComplexArray:
    output = outputs.end_torque(rig, rig.ft_end) if name == "ft" else outputs.position()
    response = frequency_response(rig, output, hz)
    return response * 2j * np.pi * hz if name == "velocity" else response


def errors(rig: Rig, r: FrequencyResponse, low: float = 1.0, high: float = 100.0) -> tuple[float, float]:
    """Return the largest error of gain, relative, and of phase, degrees."""
    inside = (r.frequency >= low) & (r.frequency <= high)
    quotient = (r.response / truth(rig, r.output, r.frequency))[inside]
    return float(np.max(np.abs(np.abs(quotient) - 1.0))), float(np.max(np.abs(np.angle(quotient, deg=True))))


@pytest.mark.parametrize(
    ("kind", "name"),
    [("white_noise", "ft"), ("white_noise", "velocity"), ("chirp", "ft"), ("multisine", "position")],
)
def test_noise_free_record_gives_the_transfer_function(kind: str, name: str) -> None:
    rig, (duration, method) = load_rig("paper_high_impedance"), KINDS[kind]
    record = synthesize(rig, command_of(kind, duration), noise=False)
    response = estimate_response(record, name)
    gain, phase = errors(rig, response)
    assert response.method == method
    assert gain < 0.01
    assert phase < 1.0


def test_the_antiresonance_of_the_moving_output_is_measured() -> None:
    rig = load_rig("paper_moving_output")
    record = synthesize(rig, command_of("chirp", 160.0), noise=False)
    gain, phase = errors(rig, estimate_response(record, "ft"))
    assert gain < 0.01
    assert phase < 1.0


def test_delay_of_the_command_is_seen_as_phase() -> None:
    rig = load_rig("paper_high_impedance")
    late = rig.with_effects(EffectSetting("command_delay", {"delay": 1.5 / RATE}))
    response = estimate_response(synthesize(late, command_of("multisine", 60.0), noise=False), "position")
    lag = np.exp(-2j * np.pi * response.frequency * 1.5 / RATE)
    quotient = response.response / truth(rig, "position", response.frequency) / lag
    inside = response.frequency < 100.0
    assert float(np.max(np.abs(quotient[inside] - 1.0))) < 0.01


def test_jitter_and_missing_samples_leave_no_bias() -> None:
    rig, command = load_rig("paper_high_impedance"), command_of("multisine", 60.0)
    rng = np.random.default_rng(7)
    stamps = command.t + (1.0 + 0.05 * rng.standard_normal(len(command))) / RATE
    response = estimate_response(sampled_at(rig, command, stamps[rng.random(len(stamps)) > 0.002]), "ft")
    error = response.response / truth(rig, "ft", response.frequency) - 1.0
    inside = (response.frequency > 1.0) & (response.frequency < 100.0)
    assert abs(error[inside].mean()) < 0.003
    assert np.mean(np.abs(response.sd / np.abs(response.response))[inside]) < 0.02


def test_a_sensor_faster_than_the_command_leaves_no_bias() -> None:
    rig, command = load_rig("paper_high_impedance"), command_of("chirp", 60.0)
    stamps = np.arange(round(command.t[-1] * 1000.0)) / 1000.0
    gain, phase = errors(rig, estimate_response(sampled_at(rig, command, stamps), "velocity"), low=2.0)
    assert gain < 0.01
    assert phase < 1.0


def test_a_missing_channel_and_a_short_record_are_named() -> None:
    record = synthesize(load_rig("bare_drive"), command_of("white_noise", 15.0))
    with pytest.raises(ChannelError, match="no channel 'ft'"):
        estimate_response(record, "ft")
    with pytest.raises(IdentificationError, match="usable samples, expected at least 32"):
        estimate_response(record.between(0.0, 0.05), "position")


def test_a_stretch_at_rest_shows_no_response() -> None:
    """A frozen encoder left only a stretch without a command: 0 over 0, and no eigenvalue converged."""
    t = np.arange(1200) / 280.0
    pulse = np.where(t > 3.0, 20.0 * np.sin(50.0 * t), 0.0)
    sensor = Channel(t, np.where(t > 2.5, np.nan, 0.01 * np.sin(t)))
    record = Record({"command": Channel(t, pulse), "position": sensor})
    with pytest.raises(AtRestError, match="position: the command never changes where all is measured"):
        estimate_response(record, "position")
    assert responses_of(record, load_rig("paper_high_impedance")) == ()


@pytest.mark.parametrize("frequency", [10.0, 20.0])
def test_a_sensor_too_slow_for_the_only_line_of_a_command_shows_no_response(frequency):
    t = np.arange(1400) / RATE
    rig = load_rig("bare_drive")
    fast = synthesize(rig, Channel(t, 5.0 * np.sin(2.0 * np.pi * frequency * t)))
    slow = np.arange(0.0, 5.0, 1.0 / 14.0)
    record = fast.with_channels(position=Channel(slow, np.interp(slow, t, fast["position"].y)))
    assert responses_of(record, rig) == ()


@pytest.mark.parametrize("offset", [0.0, 0.3, -0.4, -1.7])
def test_closed_form_is_the_sum_over_images(offset: float) -> None:
    x, k = np.array([0.05, 0.3, 0.44]), np.arange(-20000, 20001)
    at = x[:, None] + k
    hold = np.sinc(at) * np.exp(-1j * np.pi * at)
    turned = hold * np.exp(2j * np.pi * k * offset)
    images = np.array([np.sum(turned / (2j * np.pi * at) ** p, axis=1) for p in (1, 2, 3, 4)])
    assert sampled_integrators(x, offset) == pytest.approx(images, rel=2e-5)


T = np.arange(1246) / 50.0


def test_a_slow_command_does_not_repeat_at_every_sample():
    """Targets at tens of Hz move less than the tolerance from one to the next."""
    assert find_periods(0.5 + 0.15 * np.cos(2 * np.pi * 0.05 * T)) is None


def test_a_slow_command_that_does_repeat_has_its_period():
    periods = find_periods(0.5 + 0.15 * np.cos(2 * np.pi * 0.15 * T))
    assert periods is not None
    assert (periods.length, periods.count) == (333, 3)


CIRCLE = np.sqrt(-np.log(0.05))
SEEDS = range(4)


def noisy(kind: str, duration: float, seed: int, level: float) -> tuple[Record, Record]:
    """Return a record without noise, and with white noise of `level` N m on its F/T sensor."""
    u = excitation(kind, ExcitationSettings(rate=RATE, duration=duration, seed=seed))
    clean = synthesize(load_rig("paper_high_impedance"), Channel(np.arange(len(u)) / RATE, u), noise=False)
    noise = level * np.random.default_rng([seed, 99]).standard_normal(len(u))
    return clean, clean.with_channels(ft=Channel(clean["ft"].t, clean["ft"].y + noise))


@pytest.mark.parametrize(
    ("kind", "duration"), [("white_noise", 40.0), ("chirp", 40.0), ("multisine", 40.0)]
)
def test_circles_contain_the_truth(kind: str, duration: float) -> None:
    inside, count = 0, 0
    for seed in SEEDS:
        clean, record = noisy(kind, duration, seed, level=0.5)
        truth, measured = estimate_response(clean, "ft"), estimate_response(record, "ft")
        within = np.abs(measured.response - truth.response) < CIRCLE * measured.sd
        band = measured.frequency < 100.0
        inside, count = inside + int(np.sum(within[band])), count + int(np.sum(band))
    assert 0.93 < inside / count < 0.975


def test_coherence_falls_with_noise() -> None:
    _, quiet = noisy("white_noise", 80.0, 1, level=0.01)
    _, loud = noisy("white_noise", 80.0, 1, level=2.0)
    high = [float(np.mean(estimate_response(r, "ft").coherence[-200:])) for r in (quiet, loud)]
    assert high[0] > 0.99
    assert high[1] < 0.5


@pytest.mark.parametrize(("effect", "distorts"), [("nonlinear_spring", True), (None, False)])
def test_distortion_is_distinguished_from_noise(effect: str | None, distorts: bool) -> None:
    rig = load_rig("paper_high_impedance")
    if effect:
        rig = rig.with_effects(EffectSetting(effect, {"cubic": 2000.0}))
    u = excitation("multisine", ExcitationSettings(rate=RATE, duration=60.0, amplitude=20.0, high=60.0))
    record = synthesize(rig, Channel(np.arange(len(u)) / RATE, u), seed=5)
    measured = estimate_response(record, "ft")
    low = measured.frequency < 12.0
    assert measured.distortion is not None and measured.noise is not None
    ratio = float(np.sqrt(np.mean(measured.distortion[low] ** 2) / np.mean(measured.noise[low] ** 2)))
    assert (ratio > 5.0) is distorts
    assert (ratio < 1.0) is not distorts
