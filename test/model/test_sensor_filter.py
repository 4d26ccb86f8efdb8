"""Known filters of sensors against slow plain ones: lsim on a fine grid, loops without our formulas."""

import functools
import math
from dataclasses import replace

import numpy as np
import pytest
from runs import RATE, RIG
from scipy.linalg import solve_discrete_are
from scipy.signal import lsim

import rsea_ros as rsea
from rsea_ros.control.law import FT, sample_rig
from rsea_ros.control.uncertainty import lag_responses
from rsea_ros.errors import RseaError
from rsea_ros.exports.others import omitted_sensors
from rsea_ros.exports.verification import ours
from rsea_ros.identification.frequency_response import model_response, responses_of
from rsea_ros.identification.missing_torque import Injector
from rsea_ros.model.rig import Sensor
from rsea_ros.model.sensor_filter import KINDS, SensorFilter
from rsea_ros.model.simulation import Plant, drive_of, simulate, synthesize
from rsea_ros.records.record import Channel, Record

FINE = 60
COMMAND = Channel(np.arange(400) / RATE, np.append(0.0, 10.0 * np.random.default_rng(0).standard_normal(399)))
NUMBERS = {
    "one_pole": (0.036,), "two_poles": (12.0, 0.4), "average": (5.0,), "exponential": (0.2,),
    "alpha_beta": (0.5, 0.1), "kalman": (2000.0,),
}  # fmt: skip


def behind(kind, *channels, rig=RIG, **changes):
    """Return a rig whose sensors have a filter of a kind."""
    known = SensorFilter(kind, NUMBERS[kind])
    changed = {n: replace(rig.sensors.get(n, Sensor()), filter=known, **changes) for n in channels}
    return replace(rig, sensors={**rig.sensors, **changed})


def averaged(u, samples):
    """Return the mean of the last samples, the first one before the start."""
    last = [u[0]] * int(samples)
    for value in u:
        last = [*last[1:], value]
        yield sum(last) / len(last)


def smoothed(u, weight):
    """Return an exponential average."""
    value = u[0]
    for new in u:
        value += weight * (new - value)
        yield value


def tracked(u, alpha, beta):
    """Return what an alpha-beta filter tracks, with a speed per second."""
    x, speed = u[0], 0.0
    for new in u:
        x += speed / RATE
        surprise = new - x
        x, speed = x + alpha * surprise, speed + beta * surprise * RATE
        yield x


def kalman(u, ratio):
    """Return the states of a Kalman filter whose covariance has settled, gain by gain."""
    f, g = np.array([[1.0, 1.0 / RATE], [0.0, 1.0]]), np.array([0.5 / RATE**2, 1.0 / RATE])
    p = np.eye(2)
    for _ in range(5000):
        p = f @ p @ f.T + ratio**2 * np.outer(g, g)
        gain = p[:, 0] / (p[0, 0] + 1.0)
        p = p - np.outer(gain, p[0])
    state = np.array([u[0], 0.0])
    for new in u:
        state = f @ state
        state = state + gain * (new - state[0])
        yield state[0]


PLAIN = {"average": averaged, "exponential": smoothed, "alpha_beta": tracked, "kalman": kalman}


@functools.cache
def fine(channel):
    """Return times on a fine grid, and a channel there."""
    t = np.arange(len(COMMAND) * FINE + 1) / (RATE * FINE)
    if channel == "motor_torque":
        return t, np.append(np.repeat(COMMAND.y, FINE), 0.0)
    asked = Record({"command": COMMAND, channel: Channel(t, np.zeros(len(t)))})
    return t, simulate(RIG, asked, refine=4)[channel]


def expected(kind, channel):
    """Return a filtered channel of the bench by other means than the simulation's."""
    if kind in PLAIN:
        return np.array(list(PLAIN[kind](synthesize(RIG, COMMAND, noise=False)[channel].y, *NUMBERS[kind])))
    t, u = fine(channel)
    if kind == "one_pole":
        system = [1.0], [NUMBERS[kind][0], 1.0]
    else:
        w = 2.0 * math.pi * NUMBERS[kind][0]
        system = [w * w], [1.0, 2.0 * NUMBERS[kind][1] * w, w * w]
    return lsim(system, u, t, interp=channel != "motor_torque")[1][FINE::FINE]


@pytest.mark.parametrize("channel", ["ft", "position", "motor_torque"])
@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_is_what_a_slow_plain_filter_gives(kind, channel):
    """In a simulated record and on a plant that is stepped, which are the same to rounding."""
    rig, want = behind(kind, channel), expected(kind, channel)
    got = synthesize(rig, COMMAND, noise=False)[channel].y
    assert np.abs(got - want).max() < 2e-4 * np.abs(want).max()
    plant = Plant(rig, RATE, noise=False)
    stepped = np.array([getattr(plant.step(u), channel) for u in COMMAND.y])
    assert stepped == pytest.approx(got, abs=1e-9 * np.abs(got).max())


def test_a_filter_of_continuous_time_sees_what_a_command_does_within_a_step():
    """Commands off the grid of the step: the current behind its filter is that of the exact course."""
    t = COMMAND.t + np.random.default_rng(1).uniform(0.0, 1e-3, len(COMMAND))
    at = t[5:] + 0.7e-3
    record = Record({"command": Channel(t, COMMAND.y), "motor_torque": Channel(at, np.zeros(len(at)))})
    got = simulate(behind("one_pole", "motor_torque"), record)["motor_torque"]
    value, want, late = COMMAND.y[0], np.empty(len(at)), NUMBERS["one_pole"][0]
    edges = [*t, at[-1] + 1.0]
    for k, held in enumerate(COMMAND.y):
        for i in np.flatnonzero((at >= edges[k]) & (at < edges[k + 1])):
            want[i] = held + (value - held) * math.exp(-(at[i] - edges[k]) / late)
        value = held + (value - held) * math.exp(-(edges[k + 1] - edges[k]) / late)
    assert np.std(got - want) < 2e-3 * np.std(want)


@pytest.mark.parametrize("index", [1e-6, 1e-2, 1.0, 100.0])
def test_the_steady_gains_are_those_of_the_riccati_equation(index):
    f, g = np.array([[1.0, 1.0], [0.0, 1.0]]), np.array([[0.5], [1.0]])
    p = solve_discrete_are(f.T, np.array([[1.0], [0.0]]), index**2 * g @ g.T, np.eye(1))
    (alpha, lead), _ = SensorFilter("kalman", (index,)).coefficients(1.0)
    assert (alpha, alpha + lead) == pytest.approx(tuple(p[:, 0] / (p[0, 0] + 1.0)), rel=1e-6)


@pytest.mark.parametrize("kind", ["two_poles", "kalman"])
def test_noise_passes_the_filter(kind):
    """A bench at rest shows the filter of white noise, and no more."""
    still = Channel(np.arange(6000) / RATE, np.zeros(6000))
    rig = behind(kind, "ft", noise=0.5, quantum=0.0)
    noise = synthesize(rig, still, seed=4)["ft"].y
    raw = synthesize(replace(rig, sensors={**rig.sensors, "ft": Sensor(noise=0.5)}), still, seed=4)["ft"].y
    if kind in PLAIN:
        want = np.array(list(PLAIN[kind](raw, *NUMBERS[kind])))
        assert noise == pytest.approx(want, abs=1e-9)
    plant = Plant(rig, RATE, seed=4)
    shown = np.std([plant.step(0.0).ft for _ in range(2500)][500:])
    assert shown == pytest.approx(np.std(noise), rel=0.15)
    assert shown < 0.7 * np.std(raw)


def test_a_filter_starts_anew_behind_a_gap():
    """Behind a pause it is at rest at the first reading: nothing is known of what it saw meanwhile."""
    whole = synthesize(RIG, COMMAND, noise=False)
    before, after = whole.between(0.0, 0.4), whole.between(0.9, 1.4)
    parts = {n: (before[n], after[n]) for n in whole.channels}
    joined = {n: Channel(np.append(a.t, b.t), np.append(a.y, b.y)) for n, (a, b) in parts.items()}
    record = Record(joined)
    raw = simulate(RIG, record)["ft"]
    for kind in KINDS:
        got, first = simulate(behind(kind, "ft"), record)["ft"], len(before["ft"])
        assert got[first] == pytest.approx(raw[first], rel=0.2)
        if kind in PLAIN:
            parts = [list(PLAIN[kind](part, *NUMBERS[kind])) for part in (raw[:first], raw[first:])]
            assert got == pytest.approx(np.concatenate(parts), abs=1e-9)


@pytest.mark.parametrize("kind", ["one_pole", "alpha_beta"])
def test_a_measured_response_is_that_before_the_filter(kind):
    rig = behind(kind, "ft", delay=4e-3)
    rig = replace(rig, sensors={n: replace(s, noise=0.0, quantum=0.0) for n, s in rig.sensors.items()})
    command = Channel(np.arange(4096) / RATE, 10.0 * np.random.default_rng(2).standard_normal(4096))
    response = responses_of(synthesize(rig, command), rig)[0]
    slow = (response.frequency > 1.0) & (response.frequency < 60.0)
    off = response.response[slow] / model_response(RIG, "ft", response.frequency[slow]) - 1.0
    assert np.quantile(np.abs(off), 0.9) < 0.05


@pytest.mark.parametrize("kind", KINDS)
def test_its_lag_is_by_how_much_a_ramp_is_late(kind):
    """A driver allows for it where it compares sensors."""
    known, t = SensorFilter(kind, NUMBERS[kind]), np.arange(3000) / RATE
    late = t[-1] - known.over(t, 1.0 / RATE)[-1]
    assert Sensor(filter=known, delay=4e-3).lag(1.0 / RATE) == pytest.approx(late + 4e-3, abs=1e-6)
    assert Sensor(delay=4e-3).lag(1.0 / RATE) == pytest.approx(4e-3)


def test_what_cannot_serve_a_filter_says_so():
    drive = behind("one_pole", "position", rig=rsea.load_rig("bare_drive"))
    with pytest.raises(RseaError, match=r"sensors\.position\.filter, expected none for a rig that is"):
        rsea.predict(rsea.simulate(drive, 10.0 * np.sin(np.arange(600) / 40.0), RATE), drive)
    with pytest.raises(RseaError, match=r"sensors\.ft\.filter, expected none for the observer"):
        rsea.Observer(behind("kalman", "ft"))
    rsea.Observer(behind("kalman", "velocity"))


def test_a_filter_survives_its_file(tmp_path):
    for kind in KINDS:
        rig = behind(kind, "ft", "velocity")
        rsea.save(rig, tmp_path / f"{kind}.yaml")
        assert rsea.load_rig(tmp_path / f"{kind}.yaml") == rig


def test_exports_say_that_they_leave_a_filter_out_and_are_compared_without():
    rig = behind("two_poles", "ft", delay=4e-3)
    assert omitted_sensors(rig, "noise")["sensors.ft.filter"] == "two_poles; pass the output through it"
    plain, compared = (ours(r, COMMAND.y[:100]) for r in (RIG, rig))
    assert all(np.array_equal(plain[n], compared[n]) for n in plain)


@pytest.mark.parametrize("kind", KINDS)
def test_the_margins_of_a_controller_have_delay_and_filter(kind):
    """Of the reading that is filtered, at the controller's rate, and of no other."""
    hz, rig = np.array([0.5, 5.0, 40.0]), behind(kind, "ft", delay=4e-3)
    (plain, _), (late, _) = (lag_responses(r, sample_rig(r, RATE), hz) for r in (RIG, rig))
    passed = SensorFilter(kind, NUMBERS[kind]).response(hz, 1.0 / RATE) * np.exp(-2j * np.pi * hz * 4e-3)
    assert late[FT] == pytest.approx(plain[FT] * passed)
    assert np.array_equal(np.delete(late, FT, axis=0), np.delete(plain, FT, axis=0))


@pytest.mark.parametrize("kind", ["one_pole", "average"])
def test_the_answer_to_a_missing_torque_is_read_behind_the_filter(kind):
    record, rig = synthesize(RIG, COMMAND, noise=False), behind(kind, "ft")
    drive, stamps = drive_of(record, RIG), {"ft": record["ft"].t}
    torque = np.sin(np.arange(len(drive.command)) / 40.0)
    plain, got = (Injector(r, drive, stamps) for r in (RIG, rig))
    if kind == "average":
        want = np.array(list(averaged(plain.answers(torque, "gear")["ft"], 5.0)))
        assert got.answers(torque, "gear")["ft"] == pytest.approx(want, abs=1e-9)
        return
    steps, t = plain.raw(torque, "gear")[:, 3], drive.step * np.arange(len(torque) + 1)
    want = lsim(([1.0], [NUMBERS[kind][0], 1.0]), steps, t)[1]
    assert got.raw(torque, "gear")[:, 3] == pytest.approx(want, abs=1e-9 * np.abs(want).max())
