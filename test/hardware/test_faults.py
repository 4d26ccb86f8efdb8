"""Faults of a motor on the wire: latched, torque zero in the cycle that sees it, over by its service."""

from contextlib import ExitStack

import pytest

from rsea_ros.errors import DeviceError
from test.hardware.conftest import driven
from test.nodes.stalls import until

WITHIN = 3
"""Cycles, and the one during which it began."""


def torques(bench, since):
    """Goal and whether torque is on, of each write that the motor has seen since."""
    return [(goal, on) for _, goal, on in bench.log(since)["torque"]]


@pytest.mark.parametrize(
    ("loop", "bits"), [(54024, 0x20), ("DM8009", 14), ("RS03", 0x10)], indirect=["loop"]
)
def test_a_hardware_error_needs_a_reboot_and_is_over_after_it(loop, bits):
    since = loop.bench.ask("alert", bits=bits)["t"]
    assert loop.until_fault(10.0) <= WITHIN
    assert str(loop.guarded.fault) == "hardware_error: overload"
    assert loop.cycles(3, 10.0) == [0.0] * 3
    assert torques(loop.bench, since)[-1] == (0, False)
    with pytest.raises(DeviceError, match="hardware error overload, expected a reboot"):
        loop.guarded.clear()
    loop.guarded.reboot()
    assert loop.acts(10.0)
    assert torques(loop.bench, since)[-1][1]


def test_a_voltage_that_sags_is_the_motors_own_error(loop):
    loop.bench.ask("sag", voltage=17.0)
    assert loop.until_fault(10.0) <= WITHIN
    assert str(loop.guarded.fault) == "hardware_error: voltage"
    assert loop.states[-1].voltage == pytest.approx(17.0)
    loop.guarded.reboot()
    assert loop.cycles(2, 10.0) == [10.0] * 2


def test_a_motor_that_rebooted_by_itself_gets_no_torque_until_it_is_cleared(loop):
    loop.device._motor.bus.reboot()
    assert loop.until_fault(10.0) <= WITHIN + 1
    assert loop.guarded.fault.cause == "no_reply"
    loop.guarded.reboot()
    assert loop.acts(10.0)


@pytest.mark.parametrize("loop", (2020,), indirect=True)
def test_a_tripped_bus_watchdog_is_a_fault_and_cleared_by_the_service(loop):
    since = loop.bench.ask("set", watchdog=-1)["t"]
    assert loop.until_fault(10.0) <= WITHIN
    assert loop.guarded.fault.cause == "refused"
    assert loop.guarded.fault.detail.endswith("or its bus watchdog has ended the torque")
    loop.guarded.clear()
    assert loop.acts(10.0)
    assert torques(loop.bench, since)[-1][0] != 0


def test_an_ft_gap_is_counted_exactly_and_is_no_fault(loop):
    loop.bench.ask("ft_gap", records=123)
    loop.cycles(20, 10.0)
    assert loop.guarded.fault is None
    assert loop.device.health()["ft_lost"] == 123


@pytest.mark.parametrize("loop", (54024, "DM8009", "RS03", "AK10-9"), indirect=True)
def test_one_lost_reply_costs_one_cycle(loop):
    answers = 1 if isinstance(loop.bench.model, str) else 2  # a read and a write each
    for kind in ("drop", "corrupt", "truncate", "wrong_crc"):
        counts = None
        for _ in range(10):  # a machine that stalls loses others too
            read, before = len(loop.states), _lost(loop)
            loop.bench.ask("misbehave", **{kind: 1.0})
            loop.cycle(10.0)
            loop.bench.ask("misbehave", **{kind: 0.0})
            loop.cycles(2, 10.0)
            counts = len(loop.states) - read, _lost(loop) - before
            if counts == (2, answers):
                break
        assert counts == (2, answers), kind  # of three cycles
    assert loop.guarded.fault is None


def _lost(loop):
    errors = loop.device.health()
    return errors.get("bus_lost", 0) + errors.get("bus_corrupt", 0)


HELD_UP = {
    **dict.fromkeys((54024, "AK10-9", "CyberGear", "mini-cheetah"), ("heldup", 1, "clear")),
    "DM8009": ("hardware_error: communication lost", 2, "reboot"),
    "RS03": ("motor_state: state is reset", 2, "clear"),
}  # fmt: skip
"""What a driver that hung hears of its supervisor or the drive's own watchdog, within how many cycles; the
service that ends it."""


def test_the_torque_of_a_driver_that_hangs_is_ended_and_it_knows_it(benches):
    """All at once: each has been commanded, and is no more."""
    with ExitStack() as begun:
        loops = {model: begun.enter_context(driven(benches(model))) for model in HELD_UP}
        until(lambda: all(loop.bench.torque() == (0, False) for loop in loops.values()))
        for model, loop in loops.items():
            cause, most, service = HELD_UP[model]
            assert loop.until_fault(10.0) <= most and str(loop.guarded.fault).startswith(cause), model
            since = loop.bench.ask("set", temperature=32)["t"]
            getattr(loop.guarded, service)()
            assert loop.acts(10.0) and torques(loop.bench, since)[-1][1]
