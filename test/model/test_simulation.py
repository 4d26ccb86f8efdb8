"""The simulation, whole or a sample at a time, against independent computations of the same numbers."""

import math

import numpy as np
import pytest
import slow
from hypothesis import given, settings, strategies as st
from random_rigs import RIG_NAMES, rigs
from scipy.linalg import expm
from scipy.signal import lsim

from rsea_ros.model.prediction_errors import in_phase, predict
from rsea_ros.model.rig import EffectSetting
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import Plant, build, run, simulate, synthesize
from rsea_ros.records.record import Channel, Record

RATE = 1120.0
SIGNALS = ("position", "velocity", "ft")


def uniform(command, rate=RATE, delay=0.0):
    """Return a record of a command on a uniform grid, with blank measurements at the end of each hold."""
    t = np.arange(len(command)) / rate
    stamps = t + 1 / rate + delay
    blank = {n: Channel(stamps.copy(), np.zeros(len(t))) for n in (*SIGNALS, "motor_torque")}
    return Record({"command": Channel(t, command), **blank}, source="test")


def signals_of(rig):
    return SIGNALS[:2] if rig.rigid_spring else SIGNALS


@settings(max_examples=20)
@given(rigs(), st.integers(0, 1000))
def test_a_linear_rig_is_exact(rig, seed):
    """Relative error below 1e-6, against scipy.signal.lsim with held input and the matrix exponential."""
    command = 20 * np.random.default_rng(seed).standard_normal(600)
    ours = simulate(rig, uniform(command))
    a, b, c = slow.state_matrices(rig)
    t = np.arange(601) / RATE
    _, by_lsim, _ = lsim((a, b[:, None], c, np.zeros((3, 1))), np.append(command, 0.0), t, interp=False)
    block = np.zeros((len(b) + 1, len(b) + 1))
    block[:-1, :-1], block[:-1, -1] = a / RATE, b / RATE
    phi, x, by_expm = expm(block), np.zeros(len(b)), []
    for u in command:
        x = phi[:-1, :-1] @ x + phi[:-1, -1] * u
        by_expm.append(c @ x)
    for i, name in enumerate(SIGNALS[: len(signals_of(rig))]):
        for expected in (by_lsim[1:, i], np.array(by_expm)[:, i]):
            np.testing.assert_allclose(ours[name], expected, rtol=0, atol=1e-6 * np.abs(expected).max())


@settings(max_examples=15)
@given(rigs(gravity=True), st.integers(0, 1000), st.floats(0.01, 2.0))
def test_a_passive_rig_never_gains_energy(rig, seed, amplitude):
    """Free motion from any state, no command: kinetic and potential energy, gravity included, only fall."""
    machine = build(rig, 4e-4, 1.0)
    n = len(machine.x) // 2
    p = slow.coordinates(rig)
    machine.x[:] = np.random.default_rng(seed).standard_normal(2 * n) * amplitude
    energy, out = [], np.empty((1, 4))
    for _ in range(1500):
        energy.append(slow.kinetic(rig, p @ machine.x[n:]) + slow.potential(rig, p @ machine.x[:n]))
        run(machine, np.zeros(1), out)
    assert np.diff(energy).max() <= 1e-9 * energy[0]


@pytest.mark.parametrize("name", RIG_NAMES)
def test_the_step_is_fine_enough(name):
    """Halving it changes no output by more than a tenth of its sensor's noise."""
    rig = load_rig(name)
    scale = 1.0 if name != "pendulum" else 0.1
    t = np.arange(2800) / 280.0
    noise = np.random.default_rng(0).standard_normal(len(t))
    record = uniform(scale * (20 * np.sin(2 * np.pi * 0.2 * t * np.exp(0.6 * t)) + 10 * noise), 280.0)
    coarse, fine = (simulate(rig, record, refine=refine) for refine in (1, 2))
    for channel, values in coarse.items():
        change = np.abs(values - fine[channel]).max()
        assert change <= 0.1 * rig.sensors[channel].noise, f"{channel}: {change:g}"


def test_a_large_swing_of_the_pendulum_is_that_of_scipy():
    from scipy.integrate import solve_ivp

    rig = load_rig("pendulum")
    inertia = rig["rotor.reflected_inertia"] + rig["spring_end.inertia"]
    damping, gravity = rig["rotor.reflected_damping"], rig["spring_end.gravity"]
    ours = simulate(rig, uniform(np.full(560, 2.5), 280.0))

    def rate(t, x):
        return [x[1], (2.5 - damping * x[1] - gravity * np.sin(x[0])) / inertia]

    at = np.arange(1, 561) / 280.0
    exact = solve_ivp(rate, (0, 2.0), [0.0, 0.0], t_eval=at, rtol=1e-11, atol=1e-12).y
    assert exact[0].max() > 1.0
    for channel, values in (("position", exact[0]), ("velocity", exact[1])):
        assert np.abs(ours[channel] - values).max() < 0.1 * rig.sensors[channel].noise


def test_sensors_round_and_are_noisy_as_the_rig_says():
    rig = load_rig("paper_high_impedance")
    record = synthesize(rig, Channel(np.arange(20000) / 280.0, np.zeros(20000)), seed=1)
    for channel, sensor in rig.sensors.items():
        y, expected = record[channel].y, sensor.noise
        if step := sensor.quantum:
            np.testing.assert_allclose(y / step, np.rint(y / step), atol=1e-6)
            noise = np.random.default_rng(2).normal(0, sensor.noise, 20000)
            expected = step * np.std(np.rint(noise / step))
        assert np.std(y) == pytest.approx(expected, rel=0.05)


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


def hum(phase):
    parameters = {"amplitude": 0.2, "frequency": 50.02, "phase": phase}
    return load_rig("paper_high_impedance").with_effects(EffectSetting("mains_interference", parameters))


@pytest.mark.parametrize("phase", [-2.9, 0.4, 2.0])
def test_the_mains_are_predicted_whenever_the_record_began(phase):
    command = 10.0 * np.random.default_rng(3).standard_normal(2800)
    record = synthesize(hum(phase), Channel(np.arange(2800) / 280.0, command), seed=5)
    phased = in_phase(hum(1.0), record).effects[0].parameters
    assert math.remainder(phased["phase"] - phase, 2.0 * math.pi) == pytest.approx(0.0, abs=0.03)
    assert phased["amplitude"] == 0.2
    noise = load_rig("paper_high_impedance").sensors["ft"].noise
    assert predict(hum(1.0), record)["ft"].rms_error == pytest.approx(noise, rel=0.05)
