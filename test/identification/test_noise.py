"""The noise floor of coloured noise, coarse steps and slow channels; a misfit never raises it."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from benches import bench, record_bench
from scipy.signal import lfilter

from rsea_ros import simulate
from rsea_ros.identification.identify import identify
from rsea_ros.identification.noise import noise_floor, step_of, top_of_band
from rsea_ros.identification.noise_level import is_noise, reestimate_noise
from rsea_ros.identification.problem import case_from, simulate_cases
from rsea_ros.identification.unknowns import Clocks
from rsea_ros.model.rig import EffectSetting, Sensor
from rsea_ros.model.rig_file import load_rig
from rsea_ros.records.record import Channel, Record

RMS = {"ft": 0.1, "position": 4e-5}


def with_coloured_noise(record, memory, channels=("ft", "position"), seed=0):
    """Return a record with more noise of first order, `memory` from sample to sample."""
    rng = np.random.default_rng(seed)
    added = {}
    for n in channels:
        white = rng.normal(size=len(record[n]) + 1000)
        noise = RMS[n] * np.sqrt(1.0 - memory**2) * lfilter([1.0], [1.0, -memory], white)[1000:]
        added[n] = Channel(record[n].t.copy(), record[n].y + noise)
    return record.with_channels(**added)


@pytest.mark.parametrize("memory", [0.9, 0.97])
@pytest.mark.parametrize("channels", [("ft",), ("position",), ("ft", "position")])
def test_coloured_noise_of_a_clean_bench_is_noise(memory, channels):
    nominal, true = bench("paper_high_impedance", 3)
    result = identify([with_coloured_noise(record_bench(true, 3, 20.0), memory, channels)], nominal)
    assert result.verdict == "adequate"
    for n in channels:
        assert 0.8 < result.times_noise[n] < 1.25
        assert result.noise_rms[n] == pytest.approx(RMS[n], rel=0.5)
    assert set(result.coloured) == set(channels)


@pytest.mark.parametrize("duration", [8.0, 14.0, 20.0])
def test_white_noise_of_a_short_record_is_not_called_coloured(duration):
    rig = load_rig("paper_high_impedance")
    for seed in range(15):
        case = case_from(record_bench(rig, seed, duration), rig)
        known = reestimate_noise(case, simulate_cases((case,), rig, Clocks({}, {}))[0])
        assert known.coloured == frozenset(), seed


def test_a_broadband_misfit_is_not_taken_for_coloured_noise():
    nominal, true = bench("paper_high_impedance", 4)
    stiction = EffectSetting("coulomb_friction", {"torque": 1.0, "creep_velocity": 0.02})
    result = identify([with_coloured_noise(record_bench(true.with_effects(stiction), 4, 20.0), 0.9)], nominal)
    assert result.verdict == "misfit"
    assert result.coloured == ()


def test_a_coarse_encoder_has_the_noise_of_its_steps():
    nominal, true = bench("paper_high_impedance", 5)
    record, step = record_bench(true, 5, 20.0), 4e-4
    q = record["position"]
    coarse = record.with_channels(position=Channel(q.t.copy(), np.round(q.y / step) * step))
    assert step_of(coarse["position"].y) == pytest.approx(step)
    result = identify([coarse], nominal)
    assert result.noise_rms["position"] == pytest.approx(step / np.sqrt(12.0), rel=0.15)
    assert result.verdict == "adequate"


def test_states_slower_than_the_commands_have_the_noise_of_their_sensors():
    nominal, true = bench("paper_high_impedance", 6)
    record = record_bench(true, 6, 20.0)
    full = identify([record], nominal)
    thin = np.searchsorted(record["position"].t, np.arange(0.02, 19.9, 0.01))
    slow = {
        n: Channel(record[n].t[thin], record[n].y[thin]) for n in ("position", "velocity", "motor_torque")
    }
    result = identify([record.with_channels(**slow)], nominal)
    assert result.verdict == "adequate"
    for n in slow:
        assert result.noise_rms[n] == pytest.approx(full.noise_rms[n], rel=0.3), n


def test_a_residual_coherent_with_another_sensor_is_not_noise():
    """A torque that both sensors see is missing in the model, however random it looks."""
    from types import SimpleNamespace

    rng = np.random.default_rng(7)
    t = np.arange(5600) / 280.0
    torque = lfilter([1.0], [1.0, -0.9], rng.normal(size=t.size))
    other = lfilter([1.0], [1.0, -0.9], rng.normal(size=t.size))

    def seen(position):
        names = ("ft", "position")
        case = SimpleNamespace(
            t=dict.fromkeys(names, t),
            mask=dict.fromkeys(names, np.ones(t.size, bool)),
            measured={"ft": torque, "position": position},
            drive=SimpleNamespace(t=t, torque=np.sin(t), q=np.cos(t), v=np.sin(3.0 * t)),
        )
        return is_noise(case, dict.fromkeys(names, np.zeros(t.size)), "ft")

    assert seen(other)
    assert not seen(torque + 0.1 * other)


@pytest.mark.parametrize("size", [64, 80])
def test_a_short_channel_does_not_show_whether_its_noise_is_flat(size):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        rms, flat = top_of_band(np.random.default_rng(0).normal(size=size))
    assert 0.2 < rms < 5.0
    assert not flat


def test_a_channel_that_repeats_the_command_has_positive_noise():
    t = np.arange(600) / 280.0
    command = Channel(t, 20.0 * np.sin(0.01 * t))
    torque = Channel(t + 1.0 / 280.0, 3.0 * command.y)
    assert noise_floor(Record({"command": command, "motor_torque": torque}), "motor_torque", Sensor()) >= 0.0


@pytest.mark.parametrize("rest", [2.0, 6.0])
def test_a_recording_that_begins_before_the_first_command_fits_as_well(rest):
    """1.15 and 1.37 times the noise: read off the whole channel, the rest before included."""
    rig = load_rig("paper_high_impedance")
    torque = 15.0 * np.random.default_rng(1).standard_normal(1400)
    run = simulate(rig, np.concatenate([np.zeros(int(280 * rest)), torque]), rate=280.0, seed=3)
    run = run.with_channels(command=run["command"].between(rest - 1e-9, np.inf))
    assert max(identify([run], rig).times_noise.values()) < 1.08
