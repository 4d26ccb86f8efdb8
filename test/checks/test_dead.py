"""Dead and frozen channels are named, each of them; rest, standstill and plateaus are neither."""

import functools
from dataclasses import replace

import numpy as np
import pytest
from independent.bench import drawn_bench, record_command, record_run
from independent.excitations import chirp_noise
from independent.hidden import hide
from scipy.signal import lfilter

from rsea_ros.checks.carried import check_diagnosable, with_check_faults
from rsea_ros.checks.check import check_record
from rsea_ros.checks.faults import check, clipping, dead_channels
from rsea_ros.errors import IdentificationError
from rsea_ros.identification.excitation import ExcitationSettings, excitation
from rsea_ros.model.rig import EffectSetting
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import synthesize
from rsea_ros.records.record import Channel, Fault, Record

RIG = load_rig("paper_high_impedance")
BENCH = drawn_bench(np.random.default_rng(2))
QUIET = BENCH.with_values(ft_noise=0.0, velocity_noise=0.0, motor_noise=0.0)
N = 280 * 8
COMMAND = chirp_noise(8.0, np.random.default_rng(3))
IN_TURNS = (np.arange(N) // 400) % 2 == 0


@functools.cache
def good():
    return record_run(BENCH, 4, duration=8.0)


def with_channel(channel, y):
    return good().with_channels(**{channel: Channel(good()[channel].t, np.asarray(y, float))})


def kinds(record):
    return {(f.kind, f.channel) for f in check_record(record, RIG).faults}


RNG = np.random.default_rng(0)
DEAD = {
    "zero": np.zeros(N),
    "a walk": np.cumsum(RNG.normal(size=N)),
    "mains": 0.5 * np.sin(2.0 * np.pi * 50.0 * np.arange(N) / 280.0) + 0.03 * RNG.normal(size=N),
}


@pytest.mark.parametrize("name", DEAD)
def test_a_dead_sensor_is_named(name):
    assert kinds(with_channel("ft", DEAD[name])) == {("dead_channel", "ft")}


@pytest.mark.parametrize(
    ("channel", "noise"), [("position", 1e-5), ("velocity", 2e-4), ("motor_torque", 0.05)]
)
def test_every_other_dead_channel_is_named_too(channel, noise):
    assert ("dead_channel", channel) in kinds(with_channel(channel, noise * RNG.normal(size=N)))


def test_a_speed_that_is_the_rate_of_the_measured_position_is_alive():
    """A joint that stuck where its rig moved: the speed had nothing of the simulation's, and was left out."""
    t = np.arange(N) / 280.0
    position = Channel(t, 0.5 * np.sin(2.0 * t) + 1e-4 * RNG.normal(size=N))
    velocity = Channel(t, np.cos(2.0 * t) + 0.02 * RNG.normal(size=N))
    record = good().with_channels(position=position, velocity=velocity)
    assert "velocity" not in {f.channel for f in dead_channels(record, {}, RIG)}
    noise = record.with_channels(velocity=Channel(t, 0.02 * RNG.normal(size=N)))
    assert "velocity" in {f.channel for f in dead_channels(noise, {}, RIG)}


@pytest.mark.parametrize(
    ("bench", "command"),
    [
        (QUIET, np.where(IN_TURNS, COMMAND, 0.0)),
        (hide(BENCH, "coulomb_friction", {"torque": 3.0}), np.where(np.arange(N) < N // 2, COMMAND, 0.0)),
        (QUIET, np.clip(COMMAND, -12.0, 12.0)),
    ],
    ids=["rests in turns", "friction, rests last", "plateaus"],
)
def test_rest_and_plateaus_are_no_faults(bench, command):
    assert kinds(record_command(bench, command, np.random.default_rng(5))) == set()


def test_a_record_in_which_nothing_moves_is_refused_in_one_line():
    record = record_command(BENCH, np.zeros(N), np.random.default_rng(5))
    with pytest.raises(IdentificationError, match="the command stays at 0 N·m and nothing moves"):
        check_diagnosable(record)


@pytest.mark.parametrize("repeats", [1, 15])
def test_a_servo_that_stands_still_is_not_clipped(repeats):
    """It stands most of the time at one of two angles, which are its largest and its smallest."""
    t = np.arange(12_000) / 1000.0
    targets = np.sign(np.sin(2.0 * np.pi * t / 4.0))
    followed = lfilter([0.01], [1.0, -0.99], 0.5 * targets)
    angle = 0.0015 * np.round(np.repeat(followed[::repeats], repeats) / 0.0015)
    assert not clipping(Channel(t, angle), "position").any()
    swing = np.repeat(np.clip(0.8 * np.sin(3.0 * t) + 0.3 * np.sin(7.1 * t), -0.8, 0.8)[::repeats], repeats)
    assert clipping(Channel(t, swing), "position").sum() == np.count_nonzero(np.abs(swing) == 0.8)


def test_where_the_driver_had_a_fault_it_is_named_before_the_dead_sensors():
    """A run that a fault had kept at zero torque was described by its sensors' noise alone."""
    still = {n: Channel(good()[n].t, 1e-3 * RNG.normal(size=N)) for n in good().channels if n != "command"}
    fault = Fault("device_fault", "/rsea/driver", np.nan, "no_reply: 3 cycles")
    record = replace(good().with_channels(**still), faults=(fault,))
    with pytest.raises(IdentificationError, match="driver latched a fault, no_reply: 3 cycles; ") as refused:
        with_check_faults(record, RIG, masks=True)
    assert str(refused.value).count("noise that has nothing to do with the other") == 1


RATE, LENGTH = 280.0, 8.0


@functools.cache
def run():
    u = excitation("white_noise", ExcitationSettings(rate=RATE, duration=LENGTH, seed=1))
    return synthesize(RIG, Channel(np.arange(len(u)) / RATE, u))


def freeze(record, names, start, stop=LENGTH + 1.0):
    """Return the record with the values of some channels held between two times, s."""
    held = {}
    for name in names:
        t, y = record[name].t, record[name].y.copy()
        at = (t > start) & (t < stop)
        y[at] = y[np.argmax(at)]
        held[name] = Channel(t, y)
    return record.with_channels(**held)


def frozen_channels(record):
    return {f.channel for f in check(record, RIG).faults if f.kind == "frozen_samples"}


@pytest.mark.parametrize(
    ("names", "span"),
    [(("position", "velocity", "ft"), (6.5,)), (("position", "ft"), (4.0, 6.0)), (("ft",), (1.0,))],
)
def test_every_channel_of_a_driver_that_stops_is_named(names, span):
    assert frozen_channels(freeze(run(), names, *span)) == set(names)


@pytest.mark.parametrize(
    ("kind", "others", "stop"),
    [("white_noise", (), 4.3), ("chirp", ("motor_torque",), 4.3), ("chirp", (), 7.0)],
)
def test_sensors_with_noise_that_hold_at_once_are_frozen_whether_or_not_the_machine_moved(kind, others, stop):
    """Nothing under 0.5 s was said; of 3 s the position was left in: 1.12 times the noise, "unexplained"."""
    u = excitation(kind, ExcitationSettings(rate=RATE, duration=LENGTH, seed=1))
    record = synthesize(RIG, Channel(np.arange(len(u)) / RATE, u))
    names = ("position", "velocity", "ft", *others)
    checked = check(freeze(record, names, 4.0, stop), RIG)
    for name in names:
        at = checked.record[name].t
        assert checked.masked[name][(at > 4.0 + 2 / RATE) & (at < stop)].all()


def test_it_is_said_from_when_to_when_and_not_that_the_machine_is_another_or_a_sensor_noisy():
    findings = check_record(freeze(run(), ("position", "velocity", "ft"), 4.0, 6.0), RIG).findings
    assert {f.kind for f in findings if f.light != "green"} == {"frozen_samples"}
    assert all("from 4.007 s to 5.996 s" in f.detail for f in findings if f.kind == "frozen_samples")


def test_a_machine_that_sticks_while_the_command_goes_on_is_not_frozen():
    """Dry friction of 15 N m under a slow command of 20 N m: all sensors without noise hold for seconds."""
    rig = RIG.with_effects(EffectSetting("coulomb_friction", {"torque": 15.0}))
    t = np.arange(int(12.0 * RATE)) / RATE
    record = synthesize(rig, Channel(t, 20.0 * np.sin(2.0 * np.pi * 0.1 * t)), noise=False)
    assert frozen_channels(record) == set()


def test_a_velocity_that_is_the_rate_of_the_position_is_steady():
    """A drive under a constant torque reaches its speed, which a coarse sensor shows as one value."""
    rig = load_rig("bare_drive")
    t = np.arange(int(10.0 * RATE)) / RATE
    record = synthesize(rig, Channel(t, 10.0 * np.sign(np.sin(2.0 * np.pi * t / 4.0))), noise=False)
    noise = Channel(t, np.random.default_rng(5).standard_normal(len(t)))
    assert {f.channel for f in check(record.with_channels(ft=noise), rig).faults} == set()
    stopped = record.with_channels(velocity=freeze(record, ("velocity",), 4.0)["velocity"], ft=noise)
    assert {f.channel for f in check(stopped, rig).faults} == {"velocity"}


def test_a_joint_that_sticks_at_its_turns_is_neither_frozen_nor_clipped():
    """A geared joint at 33 Hz rests half a second at each turn: "clipping", then "frozen samples"."""
    rig, rng, t = load_rig("bare_drive"), np.random.default_rng(4), np.arange(1000) / 33.0
    wave = np.sin(2.0 * np.pi * 0.1 * t)
    q = np.round(0.45 * np.clip(1.05 * wave, -1.0, 1.0) / 3.81e-4) * 3.81e-4
    v = np.round((np.gradient(q, t) + 0.003 * rng.standard_normal(len(t))) / 0.0049) * 0.0049
    torque = 0.4 * np.cos(2.0 * np.pi * 0.1 * t)
    values = {"command": torque, "position": q, "velocity": v, "motor_torque": torque}
    record = Record({n: Channel(t, y) for n, y in values.items()})
    assert not {f.kind for f in check(record, rig).faults} & {"frozen_samples", "clipping"}
    assert frozen_channels(freeze(record, ("position",), 1.0, 4.0)) == {"position"}
