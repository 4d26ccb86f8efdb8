"""The simulated motor does what the e-manual says, in numbers worked out by hand."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from rsea_ros.hardware.device import State
from rsea_ros.hardware.peer.peer_motor import ACCESS, LENGTH, EmulatedEncoder, EmulatedMotor

UNIT = 2.69e-3 * 1.783
"""N m of a count of an XM430-W350's current."""
MOST = 1193
RPM = 0.229 * 2.0 * math.pi / 60.0
TURN = 2.0 * math.pi / 4096.0


class Plant:
    def __init__(self, **values: float) -> None:
        self.state, self.held = replace(State(0, 0.0, 0.0, 0.0), **values), []

    def read(self) -> State:
        return self.state

    def write(self, torque: float) -> None:
        self.held.append(torque)


def motor(mode: int = 0, torque: int = 1, sign: int = 1, **items: int) -> EmulatedMotor:
    made = EmulatedMotor(1020, Plant(position=0.3, velocity=0.05, motor_torque=0.7))
    made.sign = sign
    for name, value in {"mode": mode, "torque_enable": torque, **items}.items():
        made.put(name, value)
    return made


@pytest.mark.parametrize(
    ("made", "torque"),
    [
        (motor(0, goal=100), 100 * UNIT), (motor(0, goal=-100), -100 * UNIT), (motor(0, 0, goal=100), 0.0),
        (motor(0, goal=100, watchdog=-1), 0.0), (motor(16, goal_pwm=177), 0.2 * MOST * UNIT),
        (motor(16, goal_pwm=885, torque_limit=50), 50 * UNIT),
        (motor(1, goal_velocity=2), (2 * RPM - 0.05) / 0.2 * MOST * UNIT),
        (motor(1, goal_velocity=99), MOST * UNIT), (motor(1, goal_velocity=-99), -MOST * UNIT),
        (motor(1, goal_velocity=2, sign=-1), (2 * RPM + 0.05) / 0.2 * MOST * UNIT),
        (motor(3, goal_position=1234 + 210), ((210 * TURN - 0.3) / 0.05 - 0.05 / 2.0) * MOST * UNIT),
        (motor(3, goal_position=1444, homing_offset=10), ((200 * TURN - 0.3) / 0.05 - 0.025) * MOST * UNIT),
    ],
)  # fmt: skip
def test_each_mode_makes_the_torque_of_its_loop(made: EmulatedMotor, torque: float) -> None:
    assert made.torque() == pytest.approx(torque)
    on = made.get("torque_enable") and made.get("mode")
    assert made.acting_goal() == (round(torque / UNIT) if on else made.get("goal"))


@pytest.mark.parametrize("sign", [1, -1])
def test_it_measures_in_its_counts(sign: int) -> None:
    made = motor(sign=sign, homing_offset=7)
    error, data = made.read(3_005_000_000, made.model.registers["current"].address, 10)
    assert error == 0 and len(data) == 10
    assert made.get("position") == 1234 + 7 + round(sign * 0.3 / TURN)
    assert made.get("velocity") == round(sign * 0.05 / RPM)
    assert made.get("current") == round(sign * 0.7 / UNIT)
    assert made.get("tick") == 3005 and int.from_bytes(data[:2], "little", signed=True) == made.get("current")
    assert made.rate == 1 and not made.alert and bytes(made.memory[:7]) == bytes([252, 3, 0, 0, 0, 0, 45])
    assert [made.read(0, at, n)[0] for at, n in ((1020, 4), (1020, 5), (0, 0))] == [0, LENGTH, LENGTH]


def test_a_watchdog_that_trips_takes_the_torque_until_it_is_cleared() -> None:
    """5 units are 100 ms since the last word."""
    made = motor(goal=100, watchdog=5)
    made.read(10, 0, 2)
    made.serve(100_000_010)
    assert made.get("watchdog") == 5 and not made.history
    made.serve(100_000_011)
    assert (made.get("watchdog"), made.get("goal"), made.torque()) == (-1, 0, 0.0)
    assert made.history[-1] == (100_000_011, 0, True) and made._plant.held == [0.0]
    assert made.write(0, 102, (5).to_bytes(2, "little")) != 0 and made.write(0, 98, b"\x00") == 0
    assert made.write(0, 102, (5).to_bytes(2, "little")) == 0 and made.torque() == pytest.approx(5 * UNIT)


def test_in_another_mode_it_stands_where_it_is_and_writes_down_where_a_torque_begins() -> None:
    made = motor(3)
    made.hold(0)
    assert made.get("goal_position") == made.get("position") == 1234 + round(0.3 / TURN)
    assert made.get("goal_velocity") == made.get("goal_pwm") == 0
    for now in (1, 2):
        made.serve(now)
        assert len(made._plant.held) == now + 1 and len(made.history) == 1, "once where it begins"


def test_an_alarm_takes_the_torque_until_a_reboot_where_shutdown_names_it() -> None:
    made = motor(goal=100, mode=0)
    made.shut_down(5, 1)
    assert made.alert and made.get("torque_enable") == 1, "1 is not in 52"
    made.shut_down(6, 4)
    assert made.get("hardware_error") == 5 and made.get("torque_enable") == 0 and made.history[-1][0] == 6
    assert made.write(7, 64, b"\x01") == ACCESS
    made.put("id", 9)
    made.reboot(8)
    assert not made.alert and made.get("id") == 9 and made.get("goal") == 0
    assert made.history[-1] == (8, 0, False)


def test_a_write_covers_whole_items_or_nothing() -> None:
    made = motor()
    assert made.write(0, 100, bytes([1, 0, 2, 0])) == 0 and (made.get("goal_pwm"), made.get("goal")) == (1, 2)
    assert made.write(0, 100, bytes([9, 0, 9])) == LENGTH and made.write(0, 101, b"\x00") == ACCESS
    assert made.write(0, 100, bytes([7, 0, 255, 127])) != 0 and made.get("goal_pwm") == 1


def test_an_encoder_measures_the_springs_angle_and_does_nothing_else() -> None:
    made = EmulatedEncoder(Plant(deflection=0.1))
    made.put("homing_offset", 4)
    made.read(0, 132, 4)
    assert made.get("position") == -777 + 4 + round(0.1 / (2.0 * math.pi) * (1 << 20))
    made.serve(1 << 60)
    assert made.write(0, 20, (5).to_bytes(4, "little")) == 0 and made.get("homing_offset") == 5
    assert made.torque() == 0.0 and made.rate == 0 and not made.history and made.get("id") == 100
