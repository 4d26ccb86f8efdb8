"""Commands take effect at their stamps, whenever they arrive before."""

import math

from rsea_ros.nodes._commands import HORIZON, MILLISECOND, WATCHDOG, CommandQueue

NOW = 1_700_000_000_000_000_000


def _queue(*commands, now=NOW):
    queue = CommandQueue()
    for stamp, torque in commands:
        queue.add(stamp, torque, now)
    return queue


def test_a_command_waits_for_its_stamp():
    queue = _queue((NOW + 10, 1.0), (NOW + 20, 2.0))
    assert queue.take(NOW + 9) == []
    assert queue.take(NOW + 10) == [(NOW + 10, 1.0)]
    assert queue.take(NOW + 30) == [(NOW + 20, 2.0)]
    assert queue.torque == 2.0


def test_a_late_command_takes_effect_at_once_and_is_counted():
    queue = _queue()
    queue.take(NOW + 100)
    queue.add(NOW + 50, 3.0, NOW + 101)
    assert queue.take(NOW + 200) == [(NOW + 100, 3.0)]
    assert queue.late == 1


def test_of_several_late_commands_the_last_one_stays_in_force():
    queue = _queue()
    queue.take(NOW + 100)
    for stamp, torque in ((NOW + 50, 9.0), (NOW + 60, 3.0)):
        queue.add(stamp, torque, NOW + 101)
    assert queue.take(NOW + 200) == [(NOW + 100, 9.0), (NOW + 100, 3.0)]
    assert queue.torque == 3.0


def test_a_command_that_arrives_after_its_stamp_but_before_the_cycle_is_not_late():
    queue = _queue()
    queue.take(NOW)
    queue.add(NOW + 50, 3.0, NOW + 90)
    assert queue.take(NOW + 100) == [(NOW + 50, 3.0)]
    assert queue.late == 0


def test_a_command_without_a_recent_stamp_takes_effect_on_arrival():
    for stamp in (0, NOW - HORIZON - 1, NOW + HORIZON + 1):
        queue = _queue((stamp, 4.0))
        assert queue.take(NOW) == [(NOW, 4.0)]
        assert queue.unstamped == 1


def test_the_watchdog_zeroes_the_torque_once():
    queue = _queue((NOW, 5.0))
    queue.take(NOW)
    assert queue.take(NOW + WATCHDOG) == []
    end = NOW + WATCHDOG + 1
    assert queue.take(end) == [(end, 0.0)]
    assert queue.take(end + MILLISECOND) == []
    assert queue.torque == 0.0 and queue.expired == 1
    assert queue.age(end) is None


def test_zero_commands_do_not_trip_the_watchdog():
    queue = _queue((NOW, 0.0))
    queue.take(NOW)
    assert queue.take(NOW + 2 * WATCHDOG) == []
    assert queue.expired == 0


def test_after_clear_the_torque_is_zero_and_nothing_waits():
    queue = _queue((NOW, 5.0), (NOW + 10, 6.0))
    queue.take(NOW)
    queue.clear()
    assert queue.torque == 0.0
    assert queue.take(NOW + 20) == []


def test_a_command_that_acts_now_overtakes_those_that_came_before_it_and_wait():
    queue = _queue((NOW + 20 * MILLISECOND, 5.0), (NOW + 40 * MILLISECOND, 6.0))
    queue.add(NOW, 0.0, NOW + MILLISECOND)
    assert queue.take(NOW + 100 * MILLISECOND) == [(NOW, 0.0)]


def test_a_command_sent_before_the_clear_is_dropped_whenever_it_arrives():
    queue = _queue()
    queue.clear(NOW)
    queue.add(NOW - MILLISECOND, 5.0, NOW - MILLISECOND)
    queue.add(NOW + MILLISECOND, 6.0, NOW + MILLISECOND)
    assert queue.take(NOW + 2 * MILLISECOND) == [(NOW + MILLISECOND, 6.0)] and queue.dropped == 1


def test_a_clock_that_is_anchored_anew_moves_everything_that_waits():
    queue = _queue((NOW + 10, 1.0))
    queue.take(NOW)
    queue.shift(-1000)
    assert queue.take(NOW - 990) == [(NOW - 990, 1.0)] and queue.age(NOW - 990) == 0.0


def test_an_age_counts_from_the_arrival_of_a_late_command():
    queue = _queue()
    queue.take(NOW)
    queue.add(NOW - 100 * MILLISECOND, 1.0, NOW + MILLISECOND)
    queue.take(NOW + 2 * MILLISECOND)
    assert queue.age(NOW + 2 * MILLISECOND) == 0.001


def test_a_command_beyond_ten_times_the_limit_is_refused_as_nan_is():
    """-1e6 N m, a unit error, was obeyed as the full torque; 1e300 ended the controller node."""
    queue = CommandQueue(limit=68.0)
    for k, torque in enumerate((1e300, -1e6, 681.0, math.nan)):
        queue.add(0, torque, k + 1)
    assert queue.refused == 4 and queue.take(10) == []
    queue.add(0, 600.0, 11)
    assert queue.take(20)[-1][1] == 600.0


def test_commands_are_taken_in_the_order_of_their_stamps():
    queue = _queue((NOW + 20, 2.0), (NOW + 10, 1.0))
    assert queue.take(NOW + 30) == [(NOW + 10, 1.0), (NOW + 20, 2.0)]
