"""The guard as tables: commands with their ages in, torques and faults out, at the edges too."""

from __future__ import annotations

import pytest

from rsea_ros.hardware.device import State
from rsea_ros.hardware.interlock import DeviceFault
from rsea_ros.hardware.limits import Guard, Limits

PERIOD = 1.0 / 64.0
"""s; a power of two, so that sums of it are exact."""


def reading(motor_torque):
    return State(0, 0.0, 0.0, motor_torque)


def guard(period=PERIOD, **limits):
    return Guard(Limits(**{"torque": 64.0, "slew": 1e9, **limits}), period)


def torques(limiter, *commands):
    """The torques of commands (wanted, age)."""
    return [limiter.allowed_torque(*c) for c in commands]


def test_a_new_guard_commands_zero_and_has_no_fault():
    new = guard()
    assert (new.torque, new.limited, new.fault, new.interlock.is_free) == (0.0, 0, None, False)


def test_a_step_of_torque_is_limited_by_default():
    """10 000 N m/s, as the driver: 10 N m a ms."""
    assert Guard(Limits(68.0), 1e-3).allowed_torque(68.0, 0.0) == pytest.approx(10.0)


def test_the_slew_limit_holds_both_ways_and_from_the_previous_torque():
    limiter = guard(slew=64.0)
    assert torques(limiter, *[(9.0, 0.0)] * 3, *[(-9.0, 0.0)] * 5) == [1, 2, 3, 2, 1, 0, -1, -2]
    assert limiter.limited == 8


def test_commands_within_the_limits_are_not_counted():
    limiter = guard()
    assert torques(limiter, (64.0, 0.0), (-64.0, 0.0), (3.0, 0.0)) == [64.0, -64.0, 3.0]
    assert limiter.limited == 0


def test_without_a_command_there_is_no_torque_and_no_fault():
    limiter = guard()
    assert torques(limiter, (9.0, 0.0), (9.0, None), (9.0, None)) == [9.0, 0.0, 0.0]
    assert limiter.fault is None and limiter.limited == 0


@pytest.mark.parametrize(("age", "tripped"), [(0.05, False), (0.0501, True)])
def test_a_command_counts_for_50_ms_by_default(age, tripped):
    limiter = guard()
    limiter.allowed_torque(9.0, 0.0)
    limiter.allowed_torque(9.0, age)
    assert (limiter.fault is not None) == tripped


def test_at_the_end_of_the_program_the_torque_is_zero_without_a_fault():
    limiter = guard()
    limiter.allowed_torque(9.0, 0.0)
    limiter.interlock.halted = True
    assert torques(limiter, (9.0, 0.0), (9.0, None)) == [0.0, 0.0]
    assert limiter.fault is None


def test_any_other_fault_makes_the_torque_zero_at_once():
    limiter = guard()
    limiter.allowed_torque(9.0, 0.0)
    limiter.trip(DeviceFault("ft"))
    assert torques(limiter, (9.0, 0.0), (9.0, 9.0), (9.0, None)) == [0.0, 0.0, 0.0]
    assert limiter.fault.cause == "ft"


@pytest.mark.parametrize("late", [None, 0.0, 99.0])
@pytest.mark.parametrize("cause", ["ft", "stopped", "temperature"])
def test_the_first_fault_stays_and_any_other_ends_its_ramp(cause, late):
    """A ramp may last 10 s: the service stop and a deflection beyond its limit did not end it."""
    limiter = guard(ramp=4 * PERIOD)
    limiter.allowed_torque(8.0, 0.0)
    limiter.trip(DeviceFault("command_timeout"))
    limiter.allowed_torque(8.0, 0.0)
    limiter.trip(DeviceFault(cause))
    assert limiter.fault.cause == "command_timeout"
    assert torques(limiter, (8.0, late), (8.0, late)) == [0.0, 0.0]


def test_a_second_silence_leaves_the_ramp_as_it_is():
    limiter = guard(ramp=4 * PERIOD)
    limiter.allowed_torque(8.0, 0.0)
    limiter.trip(DeviceFault("command_timeout"))
    limiter.allowed_torque(8.0, 0.0)
    limiter.trip(DeviceFault("command_timeout"))
    assert torques(limiter, (8.0, 0.0), (8.0, 0.0)) == [4.0, 2.0]


@pytest.mark.parametrize("age", [None, 0.0])
@pytest.mark.parametrize(("ramp", "expected"), [
    (4 * PERIOD, [6, 4, 2, 0, 0]),
    (PERIOD, [0, 0, 0, 0, 0]),
    (0.0, [0, 0, 0, 0, 0]),  # a ramp shorter than a cycle takes one
])  # fmt: skip
def test_the_ramp_takes_its_duration_and_one_cycle_at_least(age, ramp, expected):
    limiter = guard(ramp=ramp)
    limiter.allowed_torque(-8.0, 0.0)
    limiter.trip(DeviceFault("command_timeout"))
    assert [abs(limiter.allowed_torque(-8.0, age)) for _ in range(5)] == expected


def test_the_ramp_takes_20_ms_by_default():
    limiter = guard(period=0.005)
    limiter.allowed_torque(8.0, 0.0)
    limiter.trip(DeviceFault("command_timeout"))
    assert [limiter.allowed_torque(8.0, 0.0) for _ in range(5)] == pytest.approx([6, 4, 2, 0, 0], abs=1e-12)


@pytest.mark.parametrize(
    ("late", "expected"), [(0.0, 6.0), (1.0, 6.0), (1.5, 5.0), (3.0, 2.0), (4.0, 0.0), (9.0, 0.0)]
)
def test_the_rest_of_the_ramp_follows_the_age_of_the_command(late, expected):
    """late: cycles since the command ceased to count, of a ramp of four."""
    limiter = guard(command_timeout=2 * PERIOD, ramp=4 * PERIOD)
    limiter.allowed_torque(8.0, 0.0)
    limiter.trip(DeviceFault("command_timeout"))
    assert limiter.allowed_torque(8.0, (2.0 + late) * PERIOD) == expected


def test_a_ramp_shorter_than_a_cycle_is_a_cycle_for_late_commands_too():
    limiter = guard(command_timeout=2 * PERIOD, ramp=0.0)
    limiter.allowed_torque(8.0, 0.0)
    assert limiter.allowed_torque(8.0, 2.5 * PERIOD) == 0.0


SOFT = {"soft_start": 128.0}
"""N m/s: 2 N m a cycle."""


def test_a_soft_start_holds_both_ways():
    assert torques(guard(**SOFT), *[(-5.0, 0.0)] * 4) == [-2.0, -4.0, -5.0, -5.0]


def test_a_soft_start_ends_at_the_torque_limit():
    assert torques(guard(torque=5.0, **SOFT), *[(9.0, 0.0)] * 4) == [2.0, 4.0, 5.0, 5.0]


@pytest.mark.parametrize(
    ("pause", "expected"),
    [
        ((0.0, 0.0), 8.0),  # a zero command is one: the start goes on
        ((0.0, 0.05), 8.0),  # as long as it counts
        ((0.0, 0.0501), 2.0),  # commands have ceased: it begins anew
        ((0.0, None), 2.0),
    ],
)
def test_a_soft_start_begins_anew_when_commands_have_ceased(pause, expected):
    limiter = guard(**SOFT)
    torques(limiter, (9.0, 0.0), (0.0, 0.0), pause)
    assert limiter.allowed_torque(9.0, 0.0) == expected


def test_there_is_no_soft_start_by_default():
    assert guard().allowed_torque(64.0, 0.0) == 64.0


def test_a_guard_begins_anew_after_it_was_cleared():
    limiter = guard(slew=128.0, **SOFT)
    torques(limiter, *[(9.0, 0.0)] * 4)
    limiter.trip(DeviceFault("ft"))
    limiter.clear()
    assert (limiter.fault, limiter.torque) == (None, 0.0)
    assert torques(limiter, *[(9.0, 0.0)] * 2) == [2.0, 4.0]


EFFORT = {"effort": 4.0, "effort_time": 3 * PERIOD}


def misses(limiter, *measured, wanted=10.0):
    """Whether there is a fault after each measured torque, under a constant command."""
    seen = []
    for torque in measured:
        limiter.allowed_torque(wanted, 0.0)
        limiter.look(reading(torque))
        seen.append(limiter.fault is not None)
    return seen


@pytest.mark.parametrize(
    ("measured", "tripped"),
    [
        ([5.9] * 5, [False, False, False, True, True]),  # 4.1 N m too little, longer than three cycles
        ([14.1] * 5, [False, False, False, True, True]),  # too much
        ([6.0] * 5, [False] * 5),  # 4 N m are allowed
        ([14.0] * 5, [False] * 5),
        ([5.9, 5.9, 5.9, 10.0, 5.9, 5.9, 5.9], [False] * 7),  # it counts from the last right one
    ],
)
def test_a_torque_that_is_missed_for_longer_than_allowed_is_a_fault(measured, tripped):
    assert misses(guard(**EFFORT), *measured) == tripped


def test_the_fault_of_a_missed_torque_says_by_how_much():
    limiter = guard(**EFFORT)
    misses(limiter, *[5.0] * 4)
    assert limiter.fault == DeviceFault("effort", 5.0, 4.0, "N m", "between commanded and measured torque")


def test_a_torque_must_be_measured_within_three_cycles():
    limiter = guard(**EFFORT)
    misses(limiter, 0.0, 0.0, 0.0, wanted=0.0)
    assert misses(limiter, 0.0, 0.0, 0.0, 0.0, 0.0, wanted=10.0) == [False] * 5, "the first miss is the third"
    assert misses(limiter, 0.0, wanted=10.0) == [True]


@pytest.mark.parametrize("measured", [10.0, -10.0])
def test_a_torque_between_the_last_ones_written_is_not_missed(measured):
    limiter = guard(**EFFORT)
    for k in range(12):
        limiter.allowed_torque(10.0 * (-1) ** k, 0.0)
        if k > 1:
            limiter.look(reading(measured))
    assert limiter.fault is None


def test_a_missed_torque_is_forgotten_when_a_fault_is_cleared():
    limiter = guard(**EFFORT)
    misses(limiter, 0.0, 0.0, 0.0)
    limiter.trip(DeviceFault("ft"))
    limiter.clear()
    limiter.look(reading(-9.0))  # nothing was written yet
    assert limiter.fault is None
    assert misses(limiter, 0.0, 0.0, 0.0, 0.0) == [False, False, False, True]


def test_a_ramp_is_not_taken_for_a_missed_torque():
    limiter = guard(**EFFORT)
    limiter.allowed_torque(10.0, 0.0)
    limiter.trip(DeviceFault("ft"))
    for _ in range(5):
        limiter.look(reading(10.0))
    limiter.interlock.fault = None
    limiter.look(reading(10.0))
    assert limiter.fault is None


def test_a_missed_torque_trips_nothing_by_default():
    assert misses(guard(), *[1e9] * 30) == [False] * 30


def test_a_missed_torque_trips_after_a_tenth_of_a_second_by_default():
    assert misses(guard(effort=4.0), *[0.0] * 7) == [False] * 6 + [True]  # 7 cycles are 0.109 s
