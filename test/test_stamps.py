"""Corrected stamps: jitter is no fault; gaps, jumps and mixed rows are; torques go behind their edge."""

from dataclasses import replace

import numpy as np
import pytest

import rsea_ros as rsea
from rsea_ros.checks.carried import with_check_faults
from rsea_ros.checks.check import check_record
from rsea_ros.errors import ChannelError
from rsea_ros.model.prediction_errors import predict
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import synthesize
from rsea_ros.records.holds import INSIDE, behind_the_edge
from rsea_ros.records.record import Channel, Record
from rsea_ros.records.stamp_order import far_apart, jumps_back
from rsea_ros.records.stamps import repair_stamps

PERIOD = 1 / 280
COUNT = 2000


def _record(t, **others):
    even = np.arange(COUNT) * PERIOD
    channels = {"command": even, "position": even + 1e-3, "ft": t, **others}
    return Record({name: Channel(np.asarray(s), np.arange(len(s)) * 1.0) for name, s in channels.items()})


@pytest.mark.parametrize("share", [0.1, 0.3, 0.49])
def test_jitter_of_the_stamps_is_no_gap(share):
    rng = np.random.default_rng(1)
    t = np.arange(COUNT) * PERIOD + rng.uniform(-share, share, COUNT) * PERIOD
    assert repair_stamps(_record(t))[1] == []


@pytest.mark.parametrize("share", [0.0, 0.3])
def test_lost_samples_are_counted_beside_jitter(share):
    rng = np.random.default_rng(2)
    t = np.arange(COUNT) * PERIOD + rng.uniform(-share, share, COUNT) * PERIOD
    keep = rng.random(COUNT) >= 0.03
    keep[[0, -1, -2, -3]] = True
    (fault,) = repair_stamps(_record(t[keep]))[1]
    assert (fault.kind, fault.size) == ("dropped_samples", COUNT - keep.sum())


@pytest.mark.parametrize("periods", [5, 100, 1000])
def test_a_jump_back_is_distinguished_from_disorder(periods):
    t = np.arange(COUNT) * PERIOD
    jumped = np.where(np.arange(COUNT) < 1500, t, t - periods * PERIOD)
    assert np.flatnonzero(jumps_back(jumped)).tolist() == [1499]
    swapped = np.concatenate([t[:500], t[700:900], t[500:700], t[900:]])
    assert not jumps_back(swapped).any()
    assert not jumps_back(np.sort(t + 0.0)[np.argsort(t + np.sin(np.arange(COUNT)) * 4 * PERIOD)]).any()


def test_a_jump_of_the_joint_states_is_found_though_they_are_three_channels():
    t = np.arange(COUNT) * PERIOD
    jumped = np.where(np.arange(COUNT) < 900, t, t + 0.5)
    record = _record(t, position=jumped, velocity=jumped, motor_torque=jumped + 0.4 * PERIOD)
    repaired, faults = repair_stamps(record)
    assert {(f.kind, f.channel) for f in faults} == {
        ("clock_jump", name) for name in ("position", "velocity", "motor_torque")
    }
    assert np.allclose(repaired["position"].t, t)


def test_a_clock_that_was_set_leaves_no_years_in_any_channel():
    t = np.arange(COUNT) * PERIOD
    years = np.where(np.arange(COUNT) < 50, 0.0, 1.7e9)
    record = _record(t + years, command=t + years, position=t + 1e-3 + years)
    repaired, faults = repair_stamps(record)
    assert [f.kind for f in faults] == ["clock_jump"] * 3 + ["pause"]
    assert repaired.stop - repaired.start < 2 * COUNT * PERIOD


def test_a_second_look_finds_nothing_new():
    t = np.arange(COUNT) * PERIOD
    t[500] = t[499]
    t[800:] += 0.5
    repaired, faults = repair_stamps(_record(t))
    assert {f.kind for f in faults} == {"duplicate_stamps", "clock_jump"}
    told = Record(repaired.channels, faults=tuple(faults))
    assert repair_stamps(told)[1] == []


def test_stamps_far_from_all_others_are_found():
    t = np.arange(1000) * 1.0
    t[[0, 500, 501]] += 1e9
    assert np.flatnonzero(far_apart(t, 3600.0)).tolist() == [0, 500, 501]
    assert not far_apart(np.array([0.0, 1e9]), 3600.0).any()


def test_stamps_that_nearly_repeat_are_repeats():
    """Half the steps a nanosecond: a grid of the median step would have 7e9 places."""
    t = np.arange(COUNT) * PERIOD
    t[1::2] = t[::2] + 1e-9
    repaired, faults = repair_stamps(_record(t))
    assert len(repaired["ft"]) == COUNT // 2
    assert [f.kind for f in faults] == ["duplicate_stamps"]


@pytest.mark.parametrize("tick", [0.005, 0.01, 1 / 64])
def test_samples_between_the_ticks_of_a_coarse_clock_get_their_own_times(tick):
    true = np.arange(COUNT) * PERIOD
    repaired, faults = repair_stamps(_record(np.floor(true / tick) * tick))
    assert np.ptp(repaired["ft"].t - true) < 0.02 * PERIOD
    (fault,) = faults
    assert (fault.kind, fault.channel) == ("coarse_stamps", "ft")
    assert fault.share == pytest.approx(1.0 - PERIOD / tick, abs=0.01)


def test_a_rate_that_halves_loses_nothing():
    """Three red lines asked for a deeper queue."""
    t = np.append(np.arange(COUNT // 2) * PERIOD, (COUNT // 2 + 2.0 * np.arange(COUNT // 4)) * PERIOD)
    assert repair_stamps(_record(t))[1] == []
    t = np.delete(t, COUNT // 2 + 200)
    assert [(f.kind, f.size) for f in repair_stamps(_record(t))[1]] == [("dropped_samples", 1.0)]


def test_samples_that_arrived_together_keep_their_order():
    """A tenth of them was left out, and the rest looked late: nothing explained a sound machine."""
    true = np.arange(COUNT) * PERIOD
    late = np.random.default_rng(3).exponential(0.6 * PERIOD, true.size)
    arrived = np.maximum.accumulate(true + late)
    record = _record(arrived).with_channels(ft=Channel(arrived, np.arange(COUNT) * 1.0))
    repaired, (fault,) = repair_stamps(record)
    assert np.array_equal(repaired["ft"].y, record["ft"].y) and np.diff(repaired["ft"].t).min() > 0.0
    assert np.abs(repaired["ft"].t - arrived).max() < 0.1 * PERIOD
    assert fault.kind == "coarse_stamps" and "arrived together" in fault.detail


def test_messages_logged_twice_are_copies_not_samples_of_a_coarse_clock():
    twice = np.repeat(np.arange(COUNT // 2) * 2.0 * PERIOD, 2)
    record = _record(twice).with_channels(ft=Channel(twice, np.repeat(np.arange(COUNT // 2), 2) * 1.0))
    repaired, faults = repair_stamps(record)
    assert len(repaired["ft"]) == COUNT // 2
    assert [f.kind for f in faults] == ["duplicate_stamps"]


def test_stamps_of_no_clock_are_refused():
    t = np.concatenate([np.arange(COUNT - 50) * 1e-9, 1.0 + np.arange(50) * 60.0])
    with pytest.raises(ChannelError, match="ft: 2000 stamps, half of them 1e-09 s apart"):
        repair_stamps(_record(t))


def test_a_sensor_that_was_silent_for_long_keeps_its_place():
    """Eleven minutes without it, while all others went on: no clock was set."""
    t = np.arange(0.0, 2000.0, 0.5)
    silent = t[(t < 600.0) | (t > 1260.0)]
    ones = {name: Channel(s.copy(), np.ones(len(s))) for name, s in (("command", t), ("ft", silent))}
    repaired, faults = repair_stamps(Record(ones))
    assert [f.kind for f in faults] == ["dropped_samples"]
    assert np.array_equal(repaired["ft"].t, silent)


def test_a_log_polled_at_two_intervals_lost_nothing():
    """A host that polled after 4 or after 10 ms was told that 30 % of its samples were dropped."""
    rng = np.random.default_rng(5)
    steps = np.where(rng.uniform(size=2000) < 0.3, 10.05e-3, 4.2e-3) * (1.0 + 0.01 * rng.normal(size=2000))
    stamps = np.cumsum(steps)
    record = Record({"ft": Channel(stamps, np.sin(stamps))})
    assert repair_stamps(record)[1] == []
    lost = np.sort(rng.choice(2000, 1900, replace=False))
    kept = 4.2e-3 * (np.arange(2000) + 0.05 * rng.normal(size=2000))[lost]
    (fault,) = repair_stamps(Record({"ft": Channel(kept, np.sin(kept))}))[1]
    assert (fault.kind, fault.size) == ("dropped_samples", pytest.approx(100, abs=2))


@pytest.mark.parametrize(
    ("start", "stop", "detail"),
    [
        (4.0, 8.0, "nothing from 0 s to 4 s"),
        (0.0, 3.0, "nothing from 3 s to 7.139 s"),
        (2.0, 3.0, "nothing from 0 s to 2 s and nothing from 3 s to 7.139 s"),
    ],
)
def test_a_sensor_that_starts_late_or_ends_early_is_reported_once(start, stop, detail):
    even = np.arange(COUNT) * PERIOD
    record, faults = repair_stamps(_record(even[(even >= start) & (even <= stop)]))
    assert [(f.kind, f.channel, f.detail) for f in faults] == [("partly_recorded", "ft", detail)]
    again = Record(record.channels, faults=tuple(faults))
    assert repair_stamps(again)[1] == []


def test_commands_that_end_early_are_reported_and_commands_that_start_late_are_not():
    even = np.arange(COUNT) * PERIOD
    still = {n: Channel(even, np.where(even > 2.1, even, 0.0)) for n in ("position", "ft")}
    late = Channel(even[even > 2.0], np.ones(np.count_nonzero(even > 2.0)))
    assert repair_stamps(Record({"command": late, **still}))[1] == []
    ((fault,),) = (repair_stamps(_record(even, command=even[even < 5.0]))[1],)
    assert (fault.kind, fault.channel) == ("partly_recorded", "command")
    assert fault.detail == "nothing from 4.996 s to 7.14 s, the last command is held"


def test_a_motion_before_the_first_command_is_reported():
    """The simulation stood still in that time: a prediction was as wrong as the motion is large."""
    even = np.arange(COUNT) * PERIOD
    motion = Channel(even, np.sin(even))
    late = Channel(even[even > 2.0], np.ones(np.count_nonzero(even > 2.0)))
    (fault,) = repair_stamps(Record({"command": late, "position": motion}))[1]
    assert (fault.kind, fault.channel, fault.detail) == (
        "partly_recorded", "command", "nothing from 0 s to 2.004 s",
    )  # fmt: skip


BENCH = rsea.load_rig("paper_high_impedance")
SOUND = rsea.simulate(BENCH, 15.0 * np.random.default_rng(1).standard_normal(4200), rate=280.0)


def sorted_after(step):
    """Return the run with a clock that steps back in the middle, its rows sorted by their stamps."""
    channels = {}
    for n, c in SOUND.channels.items():
        t = np.where(c.t > 7.5, c.t - step, c.t)
        order = np.argsort(t, kind="stable")
        channels[n] = Channel(t[order], c.y[order])
    return SOUND.with_channels(**channels)


@pytest.mark.parametrize("step", [3.0, 3.0013])
def test_rows_of_two_times_are_left_out_and_the_rest_is_sound(step):
    """17 % were read as duplicates, and 7.8 times the noise came with reassuring intervals."""
    record, faults = repair_stamps(sorted_after(step))
    assert {f.kind for f in faults} == {"mixed_rows", "dropped_samples"}
    (mixed,) = [f for f in faults if f.kind == "mixed_rows"]
    assert mixed.size == pytest.approx(step, abs=0.2) and "stepped back" in mixed.detail
    sound = rsea.predict(BENCH, SOUND)
    left = rsea.predict(BENCH, record)
    for n in ("ft", "position", "velocity"):
        assert left[n].rms_error == pytest.approx(sound[n].rms_error, rel=0.2)


def test_messages_that_came_twice_are_no_mixed_rows():
    twice = {}
    for n, c in SOUND.channels.items():
        k = np.repeat(np.arange(len(c)), np.where(abs(c.t - 7.0) < 2.0, 2, 1))
        twice[n] = Channel(c.t[k], c.y[k])
    record = SOUND.with_channels(**twice)
    assert {f.kind for f in repair_stamps(record)[1]} == {"duplicate_stamps"}


def test_a_log_whose_rate_halves_keeps_every_row():
    """`the clock stepped back by 18.6 s`, and 76 % of a sound record left out: the dense half of it."""
    sparse = {}
    for n, c in SOUND.channels.items():
        k = np.r_[np.arange(0, 2100), np.arange(2100, len(c), 2)]
        sparse[n] = Channel(c.t[k], c.y[k])
    record, faults = repair_stamps(SOUND.with_channels(**sparse))
    assert "mixed_rows" not in {f.kind for f in faults}
    assert len(record["position"]) == len(sparse["position"])


def test_rows_that_are_left_out_can_be_kept_and_are_red():
    mixed = sorted_after(3.0013)
    assert len(repair_stamps(replace(mixed, keeps_rows=True))[0]["ft"]) == len(SOUND["ft"])
    (left_out,) = [f for f in check_record(mixed, BENCH).findings if f.kind == "mixed_rows"]
    assert left_out.light == "red" and "--keep-rows" in left_out.remedy


def with_a_pause(seconds, turned=()):
    """Return two runs of one bench with a pause of the recorder between them."""
    second = rsea.simulate(BENCH, 15.0 * np.random.default_rng(2).standard_normal(4200), rate=280.0)
    channels = {}
    for n, c in SOUND.channels.items():
        y = -second[n].y if n in turned else second[n].y
        channels[n] = Channel(np.r_[c.t, second[n].t + SOUND.stop + seconds], np.r_[c.y, y])
    return SOUND.with_channels(**channels)


@pytest.mark.parametrize("seconds", [20.0, 45.0, 590.0])
def test_a_pause_of_the_recorder_is_one_line_and_convicts_nobody(seconds):
    """Five red `dropped samples`, and `sign` by the straight line that was drawn through the pause."""
    findings = check_record(with_a_pause(seconds), BENCH)
    (pause,) = [f for f in findings.findings if f.light != "green"]
    assert (pause.light, pause.kind, pause.channel, pause.unit) == ("amber", "pause", "", "s")
    assert pause.value == pytest.approx(seconds, abs=0.01)
    assert "nothing recorded from 15 s to" in pause.detail and "begins anew" in pause.detail
    again, faults = repair_stamps(with_a_pause(seconds))
    assert [f.kind for f in faults] == ["pause"]
    assert repair_stamps(replace(again, faults=tuple(faults)))[1] == []


def test_behind_a_pause_of_an_hour_the_simulation_begins_anew():
    """It passed for a clock that was set, and the second run went on from the first: 2.7 times the noise."""
    record, faults = repair_stamps(with_a_pause(3600.0))
    assert {f.kind for f in faults} == {"clock_jump", "pause"}
    sound, both = rsea.predict(BENCH, SOUND), rsea.predict(BENCH, record)
    for n in ("ft", "position", "velocity"):
        assert both[n].rms_error == pytest.approx(sound[n].rms_error, rel=0.1)


def test_what_differs_behind_a_pause_is_told_with_its_times():
    findings = check_record(with_a_pause(45.0, turned=("ft",)), BENCH)
    (sign,) = [f for f in findings.findings if f.light == "red"]
    assert (sign.kind, sign.channel) == ("sign", "ft") and "from 60 s to 75 s" in sign.detail


def test_a_stop_of_the_recorder_for_less_is_lost_rows():
    faults = repair_stamps(with_a_pause(1.0))[1]
    assert {f.kind for f in faults} == {"dropped_samples"} and len(faults) == 5


H, ROWS = 1 / 280, 2800
RNG = np.random.default_rng(5)
U = 15.0 * RNG.standard_normal(ROWS)
T = H * np.arange(ROWS)
ENDED = np.concatenate([[0.0], U[:-1]])


def driven(y, t=T, u=U, **others):
    made = {"command": Channel(T, u), "motor_torque": Channel(t, y + 0.05 * RNG.standard_normal(len(y)))}
    return Record({**made, **others})


def test_a_torque_of_the_command_that_begins_moves_behind_its_edge():
    repaired, (fault,) = repair_stamps(driven(0.9 * U + 0.3))
    assert (fault.kind, fault.channel, fault.share) == ("early_torque", "motor_torque", 1.0)
    assert np.allclose(repaired["motor_torque"].t, T + INSIDE * H)
    assert repair_stamps(repaired)[1] == [], "a second pass changes nothing"


@pytest.mark.parametrize(
    "record",
    [
        driven(ENDED),  # the convention
        driven(np.concatenate([[0.0], 0.4 * U[:-1] + 0.6 * ENDED[:-1]])),  # late: a slow current loop
        driven(U, t=T + 0.4 * H),  # between two commands: no doubt
        driven(U[:40], t=T[:40]),  # too few
        driven(RNG.standard_normal(ROWS)),  # of neither
        driven(np.full(ROWS, 3.0), u=np.full(ROWS, 3.0)),  # a command that never changes
        driven(U, reference=Channel(T, U)),  # its commands are those of a simulated loop
    ],
)
def test_any_other_torque_stays(record):
    repaired, faults = behind_the_edge(record)
    assert faults == []
    assert repaired is record


@pytest.mark.parametrize("size", [1e-300, 1e300])
def test_no_square_of_a_huge_or_tiny_torque_overflows(size):
    assert not behind_the_edge(driven(size * ENDED, u=size * U))[1]


def test_a_slow_command_decides_it_where_the_noise_lets_it():
    slow = 20.0 * np.sin(2 * np.pi * 1.0 * T)
    assert behind_the_edge(driven(slow, u=slow))[1]
    noisy = driven(slow + RNG.standard_normal(ROWS), u=slow)
    assert not behind_the_edge(noisy)[1]


@pytest.mark.parametrize("step", [10, 1, 0.2, 0.1])
def test_a_torque_at_another_rate_still_shows_its_commands(step):
    t = np.arange(0.0, ROWS, step) * H
    shown = np.minimum(np.floor(t / H + 1e-6).astype(int), ROWS - 1)
    repaired, faults = behind_the_edge(driven(U[shown], t=t))
    assert len(faults) == 1
    moved = repaired["motor_torque"].t
    assert np.all((moved > T[shown]) & (moved < T[shown] + 0.99 * H))


@pytest.mark.parametrize(("rate", "late"), [(100.0, 0.0), (280.0, 0.1), (280.0, 0.5), (2000.0, 0.9)])
def test_a_torque_that_is_read_after_its_command_fits_however_late(rate, late):
    rig = load_rig("paper_high_impedance")
    t = np.arange(1000) / rate
    made = synthesize(rig, Channel(t, U[:1000]), seed=1)
    read_after = made.with_channels(motor_torque=driven(U[:1000], t=t + late / rate)["motor_torque"])
    repaired, _ = repair_stamps(read_after)
    assert predict(rig, repaired)["motor_torque"].rms_error < 0.1


def test_a_sound_bench_that_reads_after_its_commands_is_told():
    rig = load_rig("paper_high_impedance")
    made = synthesize(rig, Channel(T, U), seed=1)
    read_after = made.with_channels(motor_torque=driven(U)["motor_torque"])
    assert predict(rig, read_after)["motor_torque"].rms_error > 10.0
    checked = check_record(read_after, rig)
    (told,) = checked.of("early_torque")
    assert (told.light, told.channel) == ("green", "motor_torque")
    assert [f.kind for f in checked.faults] == ["early_torque"]
    assert not check_record(made, rig).of("early_torque")
    assert np.allclose(with_check_faults(read_after, rig, masks=False)["motor_torque"].t, T + INSIDE * H)
    masked = with_check_faults(read_after, rig, masks=True)
    assert np.allclose(masked["motor_torque"].t, T), "its next stage does"
