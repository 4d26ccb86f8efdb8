"""A channel beside the command: its clock, offset and gaps, and a torque read at the end of a hold."""

import numpy as np
import pytest

from rsea_ros.errors import IdentificationError
from rsea_ros.identification.local_polynomial import align, clock, usable, widen
from rsea_ros.records.record import Channel, Record

PERIOD, COUNT = 0.004, 600
STAMPS = 0.1 + PERIOD * np.arange(COUNT)
COMMAND = np.random.default_rng(1).standard_normal(COUNT)


def beside(name, t, y):
    return align(Record({"command": Channel(STAMPS, COMMAND), name: Channel(t, y)}), name)


@pytest.mark.parametrize("offset", [0.0, 0.3, -0.2])
def test_a_channel_is_laid_at_its_own_offset(offset):
    t = STAMPS[20:] + offset * PERIOD
    made = beside("ft", t, 2.0 + 3.0 * t)
    assert (made.name, made.held, made.rate) == ("ft", False, pytest.approx(250.0))
    assert made.start == pytest.approx(STAMPS[20]) and made.period == pytest.approx(PERIOD)
    assert made.delay == pytest.approx(offset * PERIOD, abs=1e-9) and made.measured.all()
    np.testing.assert_allclose(made.command, COMMAND[20:], atol=1e-6)
    np.testing.assert_allclose(made.output, 2.0 + 3.0 * t, atol=1e-9)
    np.testing.assert_allclose(made.offsets, offset, atol=1e-6)


def test_a_gap_is_not_measured_and_a_motor_torque_is_of_the_command_before():
    keep = (np.arange(COUNT) < 200) | (np.arange(COUNT) >= 230)
    made = beside("ft", STAMPS[keep], COMMAND[keep])
    assert set(range(200, 230)) <= set(np.flatnonzero(~made.measured)) <= set(range(200, 231))
    torque = beside("motor_torque", STAMPS, np.concatenate([[0.0], COMMAND[:-1]]))
    assert torque.held
    np.testing.assert_allclose(
        torque.output[: len(torque.command)], torque.command[: len(torque.output)], atol=1e-6
    )


def test_a_faster_channel_divides_the_clock_of_the_command():
    t = 0.1 + 0.5 * PERIOD * np.arange(2 * COUNT)
    made = beside("position", t, t)
    assert made.period == pytest.approx(0.5 * PERIOD) and made.rate == pytest.approx(500.0)
    np.testing.assert_allclose(made.command[:20], np.repeat(COMMAND[:10], 2), atol=1e-6)


def test_the_clock_behind_jitter_and_gaps():
    rng = np.random.default_rng(3)
    keep = rng.random(COUNT) > 0.1
    start, period = clock((STAMPS + 2e-4 * rng.standard_normal(COUNT))[keep])
    assert period == pytest.approx(PERIOD, abs=2e-7) and start == pytest.approx(STAMPS[keep][0], abs=1e-4)


def test_what_is_no_number_or_steps_back_is_left_out_and_too_little_refused():
    y, t = np.arange(100.0), np.arange(100.0)
    y[5], t[10], t[20], t[30] = np.nan, np.inf, 3.0, t[29]
    left = usable(Channel(t, y), "bag: ft")
    assert len(left) == 96 and {5.0, 10.0, 20.0, 30.0}.isdisjoint(left.y.tolist())
    usable(Channel(np.arange(32.0), np.zeros(32)), "bag: ft")
    with pytest.raises(IdentificationError, match="bag: ft has 31 usable samples"):
        usable(Channel(np.arange(31.0), np.zeros(31)), "bag: ft")
    with pytest.raises(IdentificationError, match="command and ft overlap for 31 samples"):
        beside("ft", 0.1 + STAMPS[31] - STAMPS[63::-1], COMMAND[:64])


@pytest.mark.parametrize("freedom", [1.0, 5.0, 40.0])
def test_a_doubt_that_is_itself_estimated_is_wider(freedom):
    """|error|^2 over its estimated variance follows F(2, 2 m): (1 + x / m)^-m = 0.05 at its 95 % point x."""
    x = float(widen(np.ones(1), freedom)[0]) ** 2 * -np.log(0.05)
    assert (1.0 + x / freedom) ** -freedom == pytest.approx(0.05)
    assert widen(np.ones(1), 0.2)[0] == widen(np.ones(1), 1.0)[0]
