"""A cycle's stamps are its deadlines, and commands take effect at theirs, whenever they arrive before."""

import math
import threading
import time

import numpy as np
import pytest

from rsea_ros.nodes._commands import HORIZON, MILLISECOND, WATCHDOG, CommandQueue
from rsea_ros.nodes._cycle import SECOND, Cycle, on_grid

NOW = 1_700_000_000_000_000_000
MS = MILLISECOND
ORDERS = {
    "a command waits for its stamp": (
        [("add", 10, 1.0, 0), ("add", 20, 2.0, 0), ("take", 9), ("take", 10), ("take", 30)],
        [[], [(10, 1.0)], [(20, 2.0)]], {"torque": 2.0},
    ),
    "in the order of their stamps": (
        [("add", 20, 2.0, 0), ("add", 10, 1.0, 0), ("take", 30)], [[(10, 1.0), (20, 2.0)]], {},
    ),
    "a late one takes effect at once and is counted": (
        [("take", 100), ("add", 50, 3.0, 101), ("take", 200)], [[], [(100, 3.0)]], {"late": 1},
    ),
    "of several late ones the last stays in force": (
        [("take", 100), ("add", 50, 9.0, 101), ("add", 60, 3.0, 101), ("take", 200)],
        [[], [(100, 9.0), (100, 3.0)]], {"torque": 3.0},
    ),
    "one that arrives after its stamp but before the cycle is not late": (
        [("take", 0), ("add", 50, 3.0, 90), ("take", 100)], [[], [(50, 3.0)]], {"late": 0},
    ),
    **{
        f"without a recent stamp it takes effect on arrival, {stamp}": (
            [("add", stamp, 4.0, 0), ("take", 0)], [[(0, 4.0)]], {"unstamped": 1},
        )
        for stamp in (-NOW, -HORIZON - 1, HORIZON + 1)
    },
    "the watchdog zeroes the torque once": (
        [("add", 0, 5.0, 0), *(("take", at) for at in (0, WATCHDOG, WATCHDOG + 1, WATCHDOG + 1 + MS))],
        [[(0, 5.0)], [], [(WATCHDOG + 1, 0.0)], []], {"torque": 0.0, "expired": 1},
    ),
    "zero commands do not trip the watchdog": (
        [("add", 0, 0.0, 0), ("take", 0), ("take", 2 * WATCHDOG)], [[(0, 0.0)], []], {"expired": 0},
    ),
    "after clear the torque is zero and nothing waits": (
        [("add", 0, 5.0, 0), ("add", 10, 6.0, 0), ("take", 0), ("clear",), ("take", 20)],
        [[(0, 5.0)], []], {"torque": 0.0},
    ),
    "one that acts now overtakes those that came before it and wait": (
        [("add", 20 * MS, 5.0, 0), ("add", 40 * MS, 6.0, 0), ("add", 0, 0.0, MS), ("take", 100 * MS)],
        [[(0, 0.0)]], {},
    ),
    "one sent before the clear is dropped whenever it arrives": (
        [("clear", 0), ("add", -MS, 5.0, -MS), ("add", MS, 6.0, MS), ("take", 2 * MS)],
        [[(MS, 6.0)]], {"dropped": 1},
    ),
    "a clock that is anchored anew moves everything that waits": (
        [("add", 10, 1.0, 0), ("take", 0), ("shift",), ("take", -990)], [[], [(-990, 1.0)]], {},
    ),
}  # fmt: skip
"""What happens: stamp, N m, arrival; cycles. What each cycle takes, and counts in the end. ns from NOW."""


@pytest.mark.parametrize("case", ORDERS)
def test_commands_take_effect_in_time(case):
    steps, expected, counts = ORDERS[case]
    queue, taken = CommandQueue(), []
    for what, *values in steps:
        if what == "add":
            stamp, torque, arrival = values
            queue.add(NOW + stamp, torque, NOW + arrival)
        elif what == "take":
            taken.append([(at - NOW, torque) for at, torque in queue.take(NOW + values[0])])
        elif what == "clear":
            queue.clear(*(NOW + at for at in values))
        else:
            queue.shift(-1000)
    assert taken == expected
    assert {name: getattr(queue, name) for name in counts} == counts


@pytest.mark.parametrize(
    ("stamp", "arrival", "at", "age"),
    [
        (0, 0, WATCHDOG + 1, None),  # after the watchdog there is no command
        (-100 * MS, MS, 2 * MS, 0.001),  # of a late one it counts from its arrival
        (0, 0, MS, 0.001),
    ],
)
def test_an_age_is_that_of_the_command_in_force(stamp, arrival, at, age):
    queue = CommandQueue()
    queue.take(NOW - MS)
    queue.add(NOW + stamp, 5.0, NOW + arrival)
    queue.take(NOW + min(at, 2 * MS))
    queue.take(NOW + at)
    assert queue.age(NOW + at) == age
    queue.shift(-1000)
    assert queue.age(NOW + at - 1000) == age


def test_a_command_beyond_ten_times_the_limit_is_refused_as_nan_is():
    """-1e6 N m, a unit error, was obeyed as the full torque; 1e300 ended the controller node."""
    queue = CommandQueue(limit=68.0)
    for k, torque in enumerate((1e300, -1e6, 681.0, math.nan)):
        queue.add(0, torque, k + 1)
    assert queue.refused == 4 and queue.take(10) == []
    queue.add(0, 600.0, 11)
    assert queue.take(20)[-1][1] == 600.0


RATE = 200.0
PERIOD = SECOND / RATE


def _stamps(count, held_up_at, catch_up):
    """Run `count` cycles, one of which takes ten periods."""
    stamps, done = [], threading.Event()

    def work(stamp):
        if len(stamps) < count:
            stamps.append(stamp)
        if len(stamps) == held_up_at:
            time.sleep(10.0 / RATE)
        if len(stamps) == count:
            done.set()

    cycle = Cycle(RATE, work, catch_up=catch_up)
    cycle.start()
    assert done.wait(30.0)
    cycle.stop()
    return np.array(stamps), cycle.timing(), cycle.left_out


def test_a_bench_that_was_held_up_catches_up_without_a_gap():
    stamps, timing, left_out = _stamps(60, 20, catch_up=True)
    assert stamps - stamps[0] == pytest.approx(np.arange(60) * PERIOD, abs=1.0)
    assert timing.missed >= 9 and left_out == 0


def test_a_driver_that_was_held_up_leaves_cycles_out_and_stays_on_the_grid():
    stamps, timing, left_out = _stamps(60, 20, catch_up=False)
    cycles = (stamps - stamps[0]) / PERIOD
    assert cycles == pytest.approx(np.round(cycles), abs=1e-6)
    assert np.all(np.diff(np.round(cycles)) >= 1)
    assert np.max(np.diff(cycles)) >= 9.5
    assert timing.missed >= 1 and left_out >= 9


def test_the_first_stamp_is_the_one_asked_for():
    stamps, done = [], threading.Event()

    def work(stamp):
        stamps.append(stamp)
        done.set()

    first = time.time_ns() + 20_000_000
    cycle = Cycle(RATE, work, catch_up=True)
    cycle.start(first)
    assert done.wait(30.0)
    cycle.stop()
    assert stamps[0] == first


def test_what_the_work_raises_is_raised_to_whoever_asks():
    cycle = Cycle(RATE, lambda stamp: 1 / 0, catch_up=True)
    cycle.start()
    cycle.thread.join(30.0)
    with pytest.raises(ZeroDivisionError):
        cycle.is_running()


@pytest.mark.parametrize("age", [3, 3000])
def test_commands_begin_a_whole_number_of_periods_after_a_measurement(age):
    """age: of the measurement, ms."""
    now = 10 * SECOND
    measured = now - age * 10**6
    first = on_grid(now, measured, 100.0)
    assert (first - measured) % (SECOND // 100) == 0 and 0 <= first - now < SECOND // 100
