"""The stamps of the cycle are its deadlines, whatever delays it."""

import threading
import time

import numpy as np
import pytest

from rsea_ros.nodes._cycle import SECOND, Cycle, on_grid

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
