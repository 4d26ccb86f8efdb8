"""The plant, one sample at a time, is the simulation of the whole record."""

from __future__ import annotations

import numpy as np
import pytest
from random_rigs import RIG_NAMES

from rsea_ros.model.plant import Plant
from rsea_ros.model.rig import EffectSetting
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import synthesize
from rsea_ros.records.record import Channel

FRICTION = EffectSetting("coulomb_friction", {"torque": 0.5})


def record_of(plant, command):
    """Return position, velocity, motor torque and ft of each step of a plant, shape (n, 4)."""
    samples = [plant.step(u) for u in command]
    return np.array([[s.position, s.velocity, s.motor_torque, s.ft] for s in samples])


@pytest.mark.parametrize("name", RIG_NAMES)
@pytest.mark.parametrize("effects", [(), (FRICTION,)], ids=["nominal", "friction"])
@pytest.mark.parametrize("rate", [280.0, 1000.0])
def test_stepping_is_simulating(name, effects, rate):
    """To the last bits: only the rounding of the stamps differs."""
    rig = load_rig(name).with_effects(*effects)
    command = np.random.default_rng(0).standard_normal(300)
    stepped = record_of(Plant(rig, rate, noise=False), command)
    whole = synthesize(rig, Channel(np.arange(300) / rate, command), noise=False)
    for i, channel in enumerate(("position", "velocity", "motor_torque", "ft")):
        if channel in whole:
            expected = whole[channel].y
            np.testing.assert_allclose(stepped[:, i], expected, rtol=0, atol=1e-11 * np.abs(expected).max())


def test_reset_begins_again():
    plant = Plant(load_rig("paper_high_impedance"), 280.0, noise=False)
    command = np.random.default_rng(1).standard_normal(50)
    first = record_of(plant, command)
    plant.reset()
    np.testing.assert_array_equal(record_of(plant, command), first)


def test_the_seed_makes_the_noise():
    rig, command = load_rig("paper_high_impedance"), np.zeros(50)
    same = [record_of(Plant(rig, 280.0, seed=5), command) for _ in range(2)]
    np.testing.assert_array_equal(*same)
    assert (record_of(Plant(rig, 280.0, seed=6), command) != same[0]).any()


def test_a_rig_without_a_spring_measures_no_torque():
    sample = Plant(load_rig("bare_drive"), 280.0).step(1.0)
    assert np.isnan(sample.ft) and np.isfinite(sample.position)
