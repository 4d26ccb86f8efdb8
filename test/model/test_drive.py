"""The meaning of stamps: commands are held from theirs, channels are read at theirs, on the grid or not."""

import numpy as np
import pytest
import slow
from random_rigs import WITH_SPRING
from runs import RATE, RIG

from rsea_ros.errors import ChannelError, IdentificationError
from rsea_ros.model.drive import LONGEST_STEP, coarser, drive_from, finer, steps_per_sample
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import simulate, simulate_drive
from rsea_ros.records.record import Channel, Record

SIGNALS = ("position", "velocity", "ft")


def record_of(stamps, command, wanted):
    """Return a record with blank measurements at the wanted stamps."""
    blank = {n: Channel(wanted.copy(), np.zeros(len(wanted))) for n in SIGNALS}
    return Record({"command": Channel(stamps, command), **blank}, source="bag")


def white(n, seed=0):
    return np.clip(15 * np.random.default_rng(seed).standard_normal(n), -40, 40)


def errors_in_noise(rig, record):
    """Return RMS and largest error of each channel against the exact response, in its sensor's noise."""
    command, wanted = record["command"], record["ft"].t
    exact = slow.respond(rig, command.t, command.y, wanted)
    ours = simulate(rig, record)
    noise = np.array([rig.sensors[n].noise for n in SIGNALS])
    errors = np.abs(np.array([ours[n] for n in SIGNALS]) - exact) / noise[:, None]
    return np.sqrt(np.mean(errors**2, axis=1)), errors.max(axis=1)


@pytest.mark.parametrize("name", WITH_SPRING)
@pytest.mark.parametrize("shift", [0.0, 0.5, 0.31])
def test_any_offset_of_the_sensors_is_exact(name, shift):
    """Half a sample and any other fraction: under a tenth of the noise, at every sample."""
    stamps = np.arange(400) / RATE
    record = record_of(stamps, white(400), stamps + (1 + shift) / RATE)
    assert errors_in_noise(load_rig(name), record)[1].max() < 0.1


@pytest.mark.parametrize("name", WITH_SPRING)
def test_jittered_stamps_cost_a_fifth_of_the_noise(name):
    """Commands and sensors late by 0.3 ms at random, each on its own; white commands of 15 N m."""
    rng = np.random.default_rng(4)
    late = [np.round(np.arange(300) / RATE + 3e-4 * rng.standard_normal(300), 5) for _ in range(2)]
    stamps, wanted = np.sort(late[0]) - np.min(late[0]), np.sort(late[1])[10:]
    record = record_of(stamps, white(300), wanted)
    rms, largest = errors_in_noise(load_rig(name), record)
    assert rms.max() < 0.2 and largest.max() < 1.0


def test_coarse_stamps_make_no_period_too_many_or_too_few():
    """Stamps of 64-bit seconds since 1970 are 2^-22 s apart: the median interval is 2e-5 off."""
    stamps = np.round(np.arange(44_800) / RATE * 2**22) / 2**22
    drive = drive_from(record_of(stamps, white(44_800), stamps + 1 / RATE))
    assert drive.step * steps_per_sample(1 / RATE) == pytest.approx(1 / RATE, rel=1e-8)


def test_after_a_dropped_command_the_last_one_is_held():
    """A command message is dropped: the previous command goes on acting."""
    stamps, command = np.arange(400) / RATE, white(400)
    kept = np.delete(np.arange(400), [100, 101, 250])
    wanted = stamps + 1 / RATE
    filled = command.copy()
    filled[[100, 101, 250]] = command[[99, 99, 249]]
    rig = RIG
    dropped = simulate(rig, record_of(stamps[kept], command[kept], wanted))
    whole = simulate(rig, record_of(stamps, filled, wanted))
    for channel in SIGNALS:
        np.testing.assert_allclose(dropped[channel], whole[channel], atol=1e-9 * np.abs(whole[channel]).max())


def test_the_first_and_the_last_state_go_on_outside_the_record():
    stamps = np.arange(50) / RATE
    wanted = np.array([-1.0, 0.0, 50 / RATE])
    rig = RIG
    ours = simulate(rig, record_of(stamps, white(50), wanted))["position"]
    assert ours[0] == ours[1] == 0.0
    assert ours[2] == pytest.approx(slow.respond(rig, stamps, white(50), wanted[2:])[0, 0], rel=1e-9)


def test_an_encoder_that_starts_elsewhere_leaves_the_spring_alone():
    """Housing turned by 0.2 rad at the start: the pendulum's 1.4 N m on the spring, not 300 N m."""
    rig = load_rig("paper_moving_output")
    stamps = np.arange(50) / RATE
    record = record_of(stamps, np.zeros(50), stamps)
    ours = simulate(rig, record.with_channels(position=Channel(stamps.copy(), np.full(50, 0.2))))
    assert ours["position"][0] == pytest.approx(0.2)
    assert abs(ours["ft"][0]) == pytest.approx(1.4, rel=0.02)


@pytest.mark.parametrize("rate", [50.0, 280.0, 1000.0, 5000.0])
def test_step_is_a_whole_fraction_of_the_period(rate):
    n = steps_per_sample(1 / rate)
    assert 1 / rate / n <= LONGEST_STEP < 1 / rate / max(n - 1, 1e-9)


@pytest.mark.parametrize(
    ("command", "message"),
    [
        (Channel(np.arange(3.0), np.zeros(3)), r"bag: command has 3 samples, expected at least 10"),
        (Channel(np.zeros(20), np.zeros(20)), r"command: median stamp interval 0 s, expected > 0 s"),
    ],
)
def test_unusable_commands_are_refused(command, message):
    with pytest.raises(IdentificationError, match=message):
        drive_from(Record({"command": command}, source="bag"))


def test_a_record_without_a_command_is_refused():
    with pytest.raises(ChannelError, match="no channel 'command'"):
        drive_from(Record({"ft": Channel(np.arange(20.0), np.zeros(20))}, source="bag"))


@pytest.mark.parametrize("shift", [0.0, 0.31])
@pytest.mark.parametrize("length", [300, 301])
def test_a_coarser_drive_is_half_as_long_and_exact_for_a_linear_rig(shift, length):
    stamps = np.arange(length) / RATE
    drive = drive_from(record_of(stamps, white(length), stamps + (1 + shift) / RATE))
    rig, coarse = RIG, coarser(drive)
    assert len(coarse.command) == len(drive.command) // 2
    fine, rough = simulate_drive(rig, drive), simulate_drive(rig, coarse)
    for n in SIGNALS:
        assert np.max(np.abs(fine[n] - rough[n])[:-2]) < 0.1 * rig.sensors[n].noise


def test_a_drive_whose_commands_change_within_longer_steps_is_left_as_it_is():
    """The motor torque of such a step would be the mean of two commands."""
    rng = np.random.default_rng(4)
    jittered = np.arange(300) / RATE + 1e-4 * rng.uniform(-1.0, 1.0, 300)
    odd = np.arange(300) / 500.0  # five steps in a command period
    for stamps in (jittered, odd):
        drive = drive_from(record_of(stamps, white(300), stamps[5:]))
        assert coarser(drive) is drive


def test_a_coarser_drive_has_four_times_the_error_of_friction():
    rig = RIG.with_effect("coulomb_friction", torque=3.0)
    stamps = np.arange(3000) / RATE
    record = record_of(stamps, white(3000), stamps + 1 / RATE)
    truth = simulate_drive(rig, drive_from(record, refine=8))
    drive = drive_from(record)
    fine, rough = (
        np.std(simulate_drive(rig, d)["position"] - truth["position"]) for d in (drive, coarser(drive))
    )
    assert fine < rough < 8.0 * fine
    assert rough < 0.2 * rig.sensors["position"].noise


@pytest.mark.parametrize("name", ["position", "velocity"])
def test_a_run_from_rest_starts_at_rest_whichever_channel_is_measured(name):
    """The other channel, zero because nobody measured it, made the first sample the state at time zero."""
    rig = load_rig("two_moving_outputs")
    stamps = np.arange(150) / 5.0
    blank = Channel(stamps + 0.2, np.zeros(150))
    record = Record({"command": Channel(stamps, white(150)), name: blank})
    moving = record.with_channels(**{name: Channel(blank.t, simulate(rig, record)[name])})
    assert drive_from(moving).initial == (0.0, 0.0)
    np.testing.assert_array_equal(simulate(rig, moving)[name], moving[name].y)


def test_a_motion_that_goes_on_is_dated_back_to_the_first_command():
    """The first sample comes a period after the first command: at 2 rad/s the joint was 7 mrad behind it."""
    stamps = np.arange(50) / RATE
    measured = stamps + 1 / RATE
    position, velocity = 0.5 + 2.0 * measured, np.full(50, 2.0)
    motion = {"position": Channel(measured, position), "velocity": Channel(measured.copy(), velocity)}
    drive = drive_from(Record({"command": Channel(stamps, np.zeros(50)), **motion}))
    assert drive.initial == pytest.approx((0.5, 2.0))
    late = {n: Channel(c.t + 5.0, c.y) for n, c in motion.items()}
    drive = drive_from(Record({"command": Channel(np.arange(2000) / RATE, np.zeros(2000)), **late}))
    assert drive.initial == (motion["position"].y[0], 2.0), "what starts 5 s late is not extrapolated"


def test_ten_seconds_in_ms_are_refused_and_slow_commands_to_fast_sensors_are_not():
    """10 s at 280 Hz given in ms were simulated as 10 000 s at 0.28 Hz, for more than a minute."""
    t = 1e3 * np.arange(2800) / RATE
    with pytest.raises(IdentificationError, match="are the stamps in s, not in ms or µs"):
        drive_from(record_of(t, white(2800), t))
    steps = np.arange(0.0, 1000.0, 5.0)
    drive_from(record_of(steps, white(200), np.arange(0.0, 1000.0, 0.1)))


LATE, LIMIT = {"command_delay": {"delay": 2.7e-3}}, {"torque_saturation": {"limit": 2.6}}
BETWEEN = {
    "delay": LATE,
    "lag": {"current_loop_lag": {"time_constant": 3e-3}},
    "limit": LIMIT,
    "late, and a limit": {**LATE, **LIMIT},
    "dead zone": {"dead_zone": {"width": 1.0, "jump": 0.0}},
    "voltage": {"voltage_sag": {"limit": 3.0, "no_load_speed": 4.0}},
    "torque constant": {"torque_constant_error": {"gain": 0.8}},
}


@pytest.mark.parametrize("name", BETWEEN)
def test_what_becomes_of_a_command_that_changes_within_a_step_is_known_there_too(name):
    """Stamps of a busy loop: off by 24 times the noise of position, 2.3 of velocity, 10 of the current.

    That is read with the next command: what is held until then counts.
    """
    dice = np.random.default_rng(4)
    t = np.cumsum(2.5e-3 * (0.7 + dice.exponential(0.3, 1600)))
    record = record_of(t, 3.5 * (dice.integers(0, 2, 1600) * 2.0 - 1.0), t[5:])
    record = record.with_channels(motor_torque=Channel(t[5:].copy(), np.zeros(1595)))
    rig = load_rig("paper_moving_output")
    for effect, parameters in BETWEEN[name].items():
        rig = rig.with_effect(effect, **parameters)
    coarse, fine = (simulate_drive(rig, drive_from(record, refine=n)) for n in (1, 16))
    for channel in SIGNALS:
        assert np.std(coarse[channel] - fine[channel]) < 0.15 * rig.sensors[channel].noise
    off = np.abs(coarse["motor_torque"] - fine["motor_torque"]) > 0.05
    assert np.mean(off) < 0.005


def test_a_late_command_beyond_a_limit_is_that_of_the_limit_late():
    """Between two held values the mean of a step is within the limit that both exceed."""
    t, command = np.cumsum(np.random.default_rng(3).uniform(0.9, 1.1, 400)) / RATE, 3.5 * white(400)
    rig = load_rig("paper_moving_output").with_effect("command_delay", delay=0.4 / RATE)
    ours = simulate(rig.with_effect("torque_saturation", limit=2.6), record_of(t, command, t[5:]))
    theirs = simulate(rig, record_of(t, np.clip(command, -2.6, 2.6), t[5:]))
    for channel in SIGNALS:
        np.testing.assert_allclose(ours[channel], theirs[channel], atol=1e-9)


@pytest.mark.parametrize("hold", ["zero", "first"])
def test_a_finer_drive_is_that_of_the_record_on_half_the_step(hold):
    dice = np.random.default_rng(5)
    t = np.cumsum(2.5e-3 * (0.7 + dice.exponential(0.3, 400)))
    record = record_of(t, white(400), t[5:])
    halved, read = finer(drive_from(record, hold=hold)), drive_from(record, hold=hold, refine=2)
    assert halved.step == pytest.approx(read.step) and halved.hold == read.hold
    if hold == "zero":
        np.testing.assert_allclose(halved.command, read.command[: len(halved.command)], atol=1e-9)
    rig = load_rig("paper_moving_output")
    ours, theirs = (simulate_drive(rig, d) for d in (halved, read))
    for channel in SIGNALS:
        assert np.std(ours[channel] - theirs[channel]) < 0.3 * rig.sensors[channel].noise
