"""What is looked at before a motor is switched on again, and what a fault leaves switched on."""

import math
from itertools import count
from types import SimpleNamespace

import pytest

from rsea_ros.errors import DeviceError
from rsea_ros.hardware.bus_motor import Unwrapper
from rsea_ros.hardware.device import NoReply
from rsea_ros.hardware.dynamixel.motor import Watchlist
from rsea_ros.hardware.interlock import DeviceFault
from rsea_ros.hardware.limits import Limits
from test.hardware.conftest import Loop, well_behaved
from test.nodes.stalls import is_stall

OTHER = {
    "another number": (("set", {"number": 5}), ("set", {"number": 0x1122334455667788}), "number 05000"),
    "another range": (("set", {"v": 30.0}), ("set", {"v": 45.0}), "range of velocity ±30, expected ±45"),
    "another model": (("model", {"number": 54025}), ("model", {"number": 54024}), "model 54025"),
    "another current limit": (("set", {"torque_limit": 100}), ("set", {"torque_limit": 620}), "current 1.6"),
}


@pytest.mark.parametrize(
    ("loop", "name", "service"),
    [
        (54024, "another model", "clear"), (54024, "another current limit", "enable"),
        ("RS03", "another number", "clear"), ("DM8009", "another range", "reboot"),
    ],
    indirect=["loop"],
)  # fmt: skip
def test_a_motor_that_is_not_the_configured_one_stays_off(loop, name, service):
    """clear_fault said that it was done, and another motor of the same ID made up to 10 N m."""
    (wrong, how), (right, back), told = OTHER[name]
    loop.guarded.guard.trip(DeviceFault("ft"))
    loop.cycles(2, 10.0)
    if service == "enable":
        loop.guarded.clear()
        loop.guarded.disable()
    since = loop.bench.ask(wrong, **how)["t"]
    with pytest.raises(DeviceError, match=told if "range" in told else f"{told}.*as it was at configure"):
        getattr(loop.guarded, service)()
    loop.cycles(3, 10.0)
    assert loop.bench.torque() == (0, False)
    assert not any(goal for _, goal, _ in loop.bench.log(since)["torque"])
    loop.bench.ask(right, **back)
    if service == "enable":
        loop.guarded.enable()
    else:
        loop.guarded.clear()
    assert loop.acts(10.0)


MODES = {
    "velocity": {"mode": 1, "goal_velocity": 3000},
    "PWM": {"mode": 16, "goal_pwm": 900},
}


@pytest.mark.parametrize(
    ("loop", "mode"), [(54024, "velocity"), (54025, "PWM")], indirect=["loop"]
)
def test_a_motor_in_another_mode_is_switched_off_for_a_goal_of_zero_does_not_stop_it(loop, mode):
    """The torque went on after the fault; the bench hid that, for its motor made none outside torque mode."""
    since = loop.bench.ask("set", **MODES[mode])["t"]
    loop.until_fault(10.0)
    loop.cycles(3, 10.0)
    assert loop.guarded.fault.cause in ("motor_state", "effort", "velocity", "deflection", "ft_torque")
    assert loop.bench.torque() == (0, False)
    acted = [goal for _, goal, on in loop.bench.log(since)["torque"] if goal and on]
    assert acted, "the bench makes the torque of that mode"
    loop.guarded.clear()
    assert loop.acts(10.0)
    assert loop.device._motor.bus.get(loop.device._motor.control_table.operating_mode) == 0


@pytest.mark.parametrize("why", ["a stop", "a fault", "a deactivation"])
def test_a_motor_that_somebody_else_switches_on_is_off_again_at_once(loop, why):
    """Another program on the port: after a fault it kept its torque, after a stop for 0.1 s."""
    if why == "a fault":
        loop.bench.ask("set", torque_enable=0)
        loop.until_fault(10.0)
    else:
        {"a stop": loop.guarded.stop, "a deactivation": loop.guarded.disable}[why]()
    loop.cycles(3, 10.0)
    since = loop.bench.ask("set", mode=1, goal_velocity=100, torque_enable=1)["t"]
    for _ in range(400):
        loop.cycle(10.0)
        if not loop.bench.torque()[1]:
            break
    log = loop.bench.log(since)["torque"]
    assert any(on for _, _, on in log) and not loop.bench.torque()[1]
    assert loop.guarded.fault.cause in ("motor_state", "no_reply")  # of a busy machine
    loop.guarded.clear()
    loop.guarded.enable()
    assert loop.acts(10.0)


@pytest.mark.parametrize("turn", [1.0 / 280.0, 0.03, 0.1])
def test_a_register_is_looked_at_by_time_also_where_cycles_are_long_and_replies_are_lost(monkeypatch, turn):
    """A lost reply was not asked for again for 0.27 s: a mode was seen after more than 1.2 s."""
    now, asked, values, every = [0.0], count(), {}, [2]

    def get(item):
        if next(asked) % every[0] == 0:
            raise NoReply("lost")
        return values.get(item, 0)

    def told_after(most):
        begun = now[0]
        while not (told := watchlist.look()) and now[0] < begun + most:
            now[0] += turn
        return told

    monkeypatch.setattr("time.monotonic", lambda: now[0])
    watchlist = Watchlist(SimpleNamespace(get=get))
    watchlist.expect(*((name, name, 0) for name in ("torque_enable", "operating_mode", "bus_watchdog")))
    for name in ("operating_mode", "bus_watchdog", "torque_enable"):
        assert told_after(2.0) == ""
        values[name] = 3
        assert told_after(1.0) == f"{name} is 3, expected 0"
        values.clear()
    every[0] = 1
    assert "could not be read" in told_after(0.6)


def test_counts_go_on_where_the_encoder_wraps_round(benches):
    """The position jumped by 26 900 rad, and the motor kept its 10 N m."""
    bench = benches()
    well_behaved(bench)
    bench.ask("set", homing_offset=2**31 - 1234 - 100)
    try:
        for _ in range(5):  # until the machine does not stall meanwhile
            loop = Loop(bench, Limits(68.0, velocity=5.0, deflection=math.inf))
            loop.guarded.enable()
            loop.cycles(60, 10.0)
            positions, fault = [state.position for state in loop.states], loop.guarded.fault
            loop.close()
            if fault is None or not is_stall(fault.cause):
                break
        turn = 2.0 * math.pi / 501_923
        assert max(positions) > 101 * turn, "it has passed the end of 31 bits"
        assert max(map(abs, positions)) < 0.1 and fault is None, fault
    finally:
        bench.ask("set", homing_offset=0)


@pytest.mark.parametrize("first", [0, 2**31 - 2, -(2**31)])
def test_unwrapped_counts_follow_any_walk(first):
    walk = [first + step for step in (0, 3, 2, -5, 1000, -10**6, 2**30)]
    unwrapper = Unwrapper()
    assert [unwrapper.take((c + 2**31) % 2**32 - 2**31) - walk[0] for c in walk] == [c - first for c in walk]
