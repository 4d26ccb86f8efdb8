"""The guard as tables: commands with their ages and faults in, torques out, at the edges too."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
import yaml

from rsea_ros.hardware.device import State
from rsea_ros.hardware.interlock import DeviceFault
from rsea_ros.hardware.limits import Guard, Limits

PERIOD = 1.0 / 64.0
"""s; a power of two, so that sums of it are exact."""
LATE = "command_timeout"
CLEAR, HALT, STOP = object(), object(), object()
ROOT = Path(__file__).resolve().parents[2]


def guard(period=PERIOD, **limits):
    return Guard(Limits(**{"torque": 64.0, "slew": 1e9, **limits}), period)


def torques(limiter, *steps):
    """Return the torques of commands: N m, or N m and age in s. A text is the cause of a fault."""
    made = []
    for step in steps:
        if step is CLEAR:
            limiter.clear()
        elif step is HALT:
            limiter.interlock.halted = True
        elif step is STOP:
            limiter.interlock.stop()
        elif isinstance(step, str):
            limiter.trip(DeviceFault(step))
        else:
            made.append(limiter.allowed_torque(*(step if isinstance(step, tuple) else (step, 0.0))))
    return made


RAMP, SOFT = {"ramp": 4 * PERIOD}, {"soft_start": 128.0}
"""s, and 2 N m a cycle."""
SILENT = {"command_timeout": 2 * PERIOD, **RAMP}
OLD, CEASED = (0.0, 0.05), (0.0, 0.0501)
TORQUES = {
    "the slew limit, both ways and from the torque before": (
        {"slew": 64.0}, [9.0] * 3 + [-9.0] * 5, [1, 2, 3, 2, 1, 0, -1, -2], None,
    ),
    "the torque limit, either way": ({}, [500.0, -500.0, 20.0], [64, -64, 20], None),
    "within the limits": ({}, [64.0, -64.0, 3.0], [64, -64, 3], None),
    "without a command": ({}, [9.0, (9.0, None), (9.0, None)], [9, 0, 0], None),
    "a command counts for 50 ms": ({}, [9.0, (9.0, 0.05)], [9, 9], None),
    "and no longer": (RAMP, [9.0, (9.0, 0.0501)], [9, 6.75], LATE),
    "at the end of the program": ({}, [9.0, HALT, 9.0, (9.0, None)], [9, 0, 0], None),
    "a stop": ({}, [9.0, STOP, 9.0, (9.0, None)], [9, 0, 0], None),
    "a stop during a ramp": (RAMP, [8.0, LATE, 8.0, STOP, 8.0, (8.0, None)], [8, 6, 0, 0], LATE),
    "any other fault, at once": ({}, [9.0, "ft", 9.0, (9.0, 9.0), (9.0, None)], [9, 0, 0, 0], "ft"),
    # A ramp may last 10 s: the service stop and a deflection beyond its limit did not end it.
    **{
        f"{cause} ends a ramp, age {age}": (
            RAMP, [8.0, LATE, 8.0, cause, (8.0, age), (8.0, age)], [8, 6, 0, 0], LATE,
        )
        for cause in ("ft", "stopped", "temperature") for age in (None, 0.0, 99.0)
    },
    "a second silence leaves the ramp": (RAMP, [8.0, LATE, 8.0, LATE, 8.0, 8.0], [8, 6, 4, 2], LATE),
    **{
        f"a ramp of {ramp / PERIOD:g} cycles, age {age}": (
            {"ramp": ramp}, [-8.0, LATE, *[(-8.0, age)] * 5], [-8, *expected], LATE,
        )
        for ramp, expected in ((4 * PERIOD, [-6, -4, -2, 0, 0]), (PERIOD, [0] * 5), (0.0, [0] * 5))
        for age in (None, 0.0)
    },
    "the ramp takes 20 ms by default": (
        {"period": 0.005}, [8.0, LATE, *[8.0] * 5], [8, 6, 4, 2, 0, 0], LATE,
    ),
    **{
        f"the rest of the ramp {late} cycles after the command ceased to count": (
            SILENT, [8.0, LATE, (8.0, (2.0 + late) * PERIOD)], [8, left], LATE,
        )
        for late, left in ((0.0, 6), (1.0, 6), (1.5, 5), (3.0, 2), (4.0, 0), (9.0, 0))
    },
    "a ramp shorter than a cycle, a late command": (
        SILENT | {"ramp": 0.0}, [8.0, LATE, (8.0, 2.5 * PERIOD)], [8, 0], LATE,
    ),
    "a late command is latched until it is cleared": (
        {"command_timeout": 0.05, **RAMP},
        [40.0, (40.0, 0.05), (40.0, 0.051), *[(40.0, 0.06)] * 4, 40.0, CLEAR, 40.0],
        [40, 40, 30, 20, 10, 0, 0, 0, 40], None,
    ),
    "a soft start, both ways": (SOFT, [-5.0] * 4, [-2, -4, -5, -5], None),
    "a soft start ends at the torque limit": ({"torque": 5.0, **SOFT}, [9.0] * 4, [2, 4, 5, 5], None),
    "a zero command is one: the soft start goes on": (SOFT, [9.0, 0.0, 0.0, 9.0], [2, 0, 0, 8], None),
    "as long as it counts": (SOFT, [9.0, 0.0, OLD, 9.0], [2, 0, 0, 8], None),
    "commands have ceased: it begins anew": (SOFT, [9.0, 0.0, CEASED, 9.0], [2, 0, 0, 2], None),
    "without a command, too": (SOFT, [9.0, 0.0, (0.0, None), 9.0], [2, 0, 0, 2], None),
    "no soft start by default": ({}, [64.0], [64], None),
    "softly and from zero after a clear": (
        {"slew": 128.0, **SOFT}, [*[9.0] * 4, "ft", 9.0, CLEAR, 9.0, 9.0], [2, 4, 6, 8, 0, 2, 4], None,
    ),
}  # fmt: skip
"""Limits, what happens, the torques (N m), the fault in the end."""


@pytest.mark.parametrize("case", TORQUES)
def test_torques_of_commands_and_faults(case):
    limits, steps, expected, cause = TORQUES[case]
    limiter = guard(**limits)
    assert torques(limiter, *steps) == pytest.approx(expected, abs=1e-12)
    assert (limiter.fault and limiter.fault.cause) == cause


def test_a_new_guard_commands_zero_and_has_no_fault():
    new = guard()
    assert (new.torque, new.limited, new.fault, new.interlock.is_free) == (0.0, 0, None, False)


@pytest.mark.parametrize(
    ("limits", "steps", "count"),
    [({"slew": 64.0}, [9.0] * 3, 3), ({}, [500.0, -500.0, 20.0], 2), ({}, [64.0, -64.0, (9.0, None)], 0)],
)
def test_commands_that_are_cut_are_counted(limits, steps, count):
    limiter = guard(**limits)
    torques(limiter, *steps)
    assert limiter.limited == count


def test_a_step_of_torque_is_limited_by_default_as_by_the_driver():
    """A Limits of one's own allowed four times the slew of the driver: 10 N m a ms."""
    driver = yaml.safe_load((ROOT / "config" / "nodes" / "driver.yaml").read_text(encoding="utf-8"))
    (parameters,) = (node["ros__parameters"] for node in driver.values())
    assert parameters["slew_limit"] == Limits(1.0).slew
    assert Guard(Limits(68.0), 1e-3).allowed_torque(68.0, 0.0) == pytest.approx(10.0)


def test_the_fault_of_late_commands_says_how_late():
    limiter = guard()
    torques(limiter, 9.0, (9.0, 0.06))
    assert str(limiter.fault) == "command_timeout: 60 ms, limit 50 ms"


@pytest.mark.parametrize(
    ("wanted", "age"),
    [(math.nan, 0.0), (math.inf, 0.0), (-1e6, 0.0), (10.0, math.nan), (10.0, -1e9), (10.0, -0.051)],
)
def test_a_command_that_is_none_leads_to_zero_within_the_slew_limit(wanted, age):
    """NaN was returned, and dropped the slew limit; -1e6 N m was obeyed as -68; an age of NaN was none.

    One of -1e9 s was fresh.
    """
    limiter = guard(slew=192.0)
    made = torques(limiter, *[10.0] * 4, *[(wanted, age)] * 4, 10.0)
    assert made[3:] == [10.0, 7.0, 4.0, 1.0, 0.0, 3.0]
    assert limiter.refused == (4 if age == 0.0 else 0)


def test_a_command_that_takes_effect_within_this_cycle_is_fresh():
    """A cycle takes what is due until half a period later, 50 ms at 10 Hz."""
    assert torques(guard(), (9.0, -0.05)) == [9.0]
    assert torques(guard(0.1), (9.0, -0.1), (9.0, -0.11)) == [9.0, 0.0]


EFFORT = {"effort": 4.0, "effort_time": 3 * PERIOD}


def misses(limiter, *measured, wanted=10.0):
    """Whether there is a fault after each measured torque, under a constant command."""
    seen = []
    for torque in measured:
        limiter.allowed_torque(wanted, 0.0)
        limiter.look(State(0, 0.0, 0.0, torque))
        seen.append(limiter.fault is not None)
    return seen


@pytest.mark.parametrize(
    ("limits", "measured", "tripped"),
    [
        (EFFORT, [5.9] * 5, [False, False, False, True, True]),  # 4.1 N m too little, over three cycles
        (EFFORT, [14.1] * 5, [False, False, False, True, True]),  # too much
        (EFFORT, [6.0] * 5, [False] * 5),  # 4 N m are allowed
        (EFFORT, [14.0] * 5, [False] * 5),
        (EFFORT, [5.9, 5.9, 5.9, 10.0, 5.9, 5.9, 5.9], [False] * 7),  # it counts from the last right one
        ({}, [1e6] * 30, [False] * 30),  # by default nothing
        ({"effort": 4.0}, [0.0] * 7, [False] * 6 + [True]),  # by default 0.1 s: 7 cycles are 0.109
    ],
)
def test_a_torque_that_is_missed_for_longer_than_allowed_is_a_fault(limits, measured, tripped):
    assert misses(guard(**limits), *measured) == tripped


def test_the_fault_of_a_missed_torque_says_by_how_much():
    limiter = guard(**EFFORT)
    misses(limiter, *[5.0] * 4)
    assert limiter.fault == DeviceFault("effort", 5.0, 4.0, "N m", "between commanded and measured torque")


def test_a_torque_must_be_measured_within_three_cycles():
    limiter = guard(**EFFORT)
    misses(limiter, 0.0, 0.0, 0.0, wanted=0.0)
    assert misses(limiter, *[0.0] * 6) == [False] * 5 + [True], "the first miss is the third"


@pytest.mark.parametrize("measured", [10.0, -10.0])
def test_a_torque_between_the_last_ones_written_is_not_missed(measured):
    limiter = guard(**EFFORT)
    for k in range(12):
        limiter.allowed_torque(10.0 * (-1) ** k, 0.0)
        if k > 1:
            limiter.look(State(0, 0.0, 0.0, measured))
    assert limiter.fault is None


def test_a_missed_torque_is_forgotten_when_a_fault_is_cleared():
    limiter = guard(**EFFORT)
    misses(limiter, 0.0, 0.0, 0.0)
    torques(limiter, "ft", CLEAR)
    limiter.look(State(0, 0.0, 0.0, -9.0))  # nothing was written yet
    assert limiter.fault is None
    assert misses(limiter, *[0.0] * 4) == [False, False, False, True]


def test_a_ramp_is_not_taken_for_a_missed_torque():
    limiter = guard(**EFFORT)
    torques(limiter, 10.0, "ft")
    for _ in range(5):
        limiter.look(State(0, 0.0, 0.0, 10.0))
    limiter.interlock.fault = None
    limiter.look(State(0, 0.0, 0.0, 10.0))
    assert limiter.fault is None
