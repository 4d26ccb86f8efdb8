"""The standard deviations of measured responses: the truth lies in the 95 % circle in 95 % of cases."""

from __future__ import annotations

import numpy as np
import pytest

from rsea_ros.identification.excitation import ExcitationSettings, excitation
from rsea_ros.identification.frequency_response import estimate_response
from rsea_ros.model.rig import EffectSetting
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import synthesize
from rsea_ros.records.record import Channel, Record

RATE = 280.0
CIRCLE = np.sqrt(-np.log(0.05))
SEEDS = range(6)


def noisy(kind: str, duration: float, seed: int, level: float) -> tuple[Record, Record]:
    """Return a record without noise, and with white noise of `level` N m on its F/T sensor."""
    u = excitation(kind, ExcitationSettings(rate=RATE, duration=duration, seed=seed))
    clean = synthesize(load_rig("paper_high_impedance"), Channel(np.arange(len(u)) / RATE, u), noise=False)
    noise = level * np.random.default_rng([seed, 99]).standard_normal(len(u))
    return clean, clean.with_channels(ft=Channel(clean["ft"].t, clean["ft"].y + noise))


@pytest.mark.parametrize(
    ("kind", "duration"), [("white_noise", 80.0), ("chirp", 60.0), ("multisine", 60.0), ("white_noise", 15.0)]
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


def test_noise_level_is_the_sensors() -> None:
    _, record = noisy("multisine", 60.0, 3, level=0.5)
    measured = estimate_response(record, "ft")
    lines = round(10.0 * RATE) / 2.0
    assert measured.noise is not None
    assert np.sqrt(np.mean(measured.noise**2) * lines) == pytest.approx(0.5, rel=0.05)


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
