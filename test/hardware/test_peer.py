"""The simulated bench: its motors and sensor do what the manuals say, in numbers worked out by hand."""

import argparse
import math
import socket
import struct
from contextlib import closing
from dataclasses import replace

import pytest

from rsea_ros.cli.bench import _motors
from rsea_ros.hardware.device import State
from rsea_ros.hardware.peer.ft import ForceSensor, Misbehaviour
from rsea_ros.hardware.peer.peer_motor import ACCESS, LENGTH, EmulatedEncoder, EmulatedMotor
from rsea_ros.hardware.peer.serial_line import EmulatedBus, instruction

UNIT = 2.69e-3 * 1.783
"""N m of a count of an XM430-W350's current."""
MOST = 1193
RPM = 0.229 * 2.0 * math.pi / 60.0
TURN = 2.0 * math.pi / 4096.0


class Plant:
    def __init__(self, **values):
        self.state, self.held = replace(State(0, 0.0, 0.0, 0.0), **values), []

    def read(self):
        return self.state

    def write(self, torque):
        self.held.append(torque)


def motor(mode=0, torque=1, sign=1, **items):
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
def test_each_mode_makes_the_torque_of_its_loop(made, torque):
    assert made.torque() == pytest.approx(torque)
    on = made.get("torque_enable") and made.get("mode")
    assert made.acting_goal() == (round(torque / UNIT) if on else made.get("goal"))


@pytest.mark.parametrize("sign", [1, -1])
def test_it_measures_in_its_counts(sign):
    made = motor(sign=sign, homing_offset=7)
    error, data = made.read(3_005_000_000, made.model.registers["current"].address, 10)
    assert error == 0 and len(data) == 10
    assert made.get("position") == 1234 + 7 + round(sign * 0.3 / TURN)
    assert made.get("velocity") == round(sign * 0.05 / RPM)
    assert made.get("current") == round(sign * 0.7 / UNIT)
    assert made.get("tick") == 3005 and int.from_bytes(data[:2], "little", signed=True) == made.get("current")
    assert made.rate == 1 and not made.alert and bytes(made.memory[:7]) == bytes([252, 3, 0, 0, 0, 0, 45])
    assert [made.read(0, at, n)[0] for at, n in ((1020, 4), (1020, 5), (0, 0))] == [0, LENGTH, LENGTH]


def test_a_watchdog_that_trips_takes_the_torque_until_it_is_cleared():
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


def test_in_another_mode_it_stands_where_it_is_and_writes_down_where_a_torque_begins():
    made = motor(3)
    made.hold(0)
    assert made.get("goal_position") == made.get("position") == 1234 + round(0.3 / TURN)
    assert made.get("goal_velocity") == made.get("goal_pwm") == 0
    for now in (1, 2):
        made.serve(now)
        assert len(made._plant.held) == now + 1 and len(made.history) == 1, "once where it begins"


def test_an_alarm_takes_the_torque_until_a_reboot_where_shutdown_names_it():
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


def test_a_write_covers_whole_items_or_nothing():
    made = motor()
    assert made.write(0, 100, bytes([1, 0, 2, 0])) == 0 and (made.get("goal_pwm"), made.get("goal")) == (1, 2)
    assert made.write(0, 100, bytes([9, 0, 9])) == LENGTH and made.write(0, 101, b"\x00") == ACCESS
    assert made.write(0, 100, bytes([7, 0, 255, 127])) != 0 and made.get("goal_pwm") == 1


def test_an_encoder_measures_the_springs_angle_and_does_nothing_else():
    made = EmulatedEncoder(Plant(deflection=0.1))
    made.put("homing_offset", 4)
    made.read(0, 132, 4)
    assert made.get("position") == -777 + 4 + round(0.1 / (2.0 * math.pi) * (1 << 20))
    made.serve(1 << 60)
    assert made.write(0, 20, (5).to_bytes(4, "little")) == 0 and made.get("homing_offset") == 5
    assert made.torque() == 0.0 and made.rate == 0 and not made.history and made.get("id") == 100


PACKET = bytes(range(100, 130))


@pytest.mark.parametrize("kind", ["silent", "drop"])
def test_a_silent_motor_and_a_dropped_reply_are_nothing(kind):
    wrong = Misbehaviour(**{kind: True if kind == "silent" else 1.0})
    assert wrong.damage(PACKET) == b"" and wrong.done == {kind: 1}


def test_each_damage_changes_what_it_says():
    crc = Misbehaviour(wrong_crc=1.0).damage(PACKET)
    assert crc[:-1] == PACKET[:-1] and crc[-1] == PACKET[-1] ^ 0x5A
    for seed in range(20):
        flipped = Misbehaviour(corrupt=1.0, seed=seed).damage(PACKET)
        assert sum((a ^ b).bit_count() for a, b in zip(flipped, PACKET, strict=True)) == 1
        short = Misbehaviour(truncate=1.0, seed=seed).damage(PACKET)
        assert 0 < len(short) < len(PACKET) and PACKET.startswith(short)
    twin = Misbehaviour(twin=True)
    assert twin.damage(PACKET[:14]) == PACKET[:14] and not twin.done, "a ping's replies are alike"
    both = twin.damage(PACKET)
    assert both[:9] == PACKET[:9] and len(both) == len(PACKET)
    assert both[9:] == bytes(b & (37 * k % 256) for k, b in enumerate(PACKET[9:]))
    assert Misbehaviour().damage(PACKET) == PACKET


def test_a_share_is_that_of_the_replies_and_counted():
    wrong = Misbehaviour(drop=0.25, seed=3)
    lost = sum(wrong.damage(PACKET) == b"" for _ in range(4000))
    assert lost == wrong.done["drop"] == pytest.approx(1000, abs=90)


def asked(sensor, client, command, count=0, now=0):
    client.sendto(struct.pack(">HHI", 0x1234, command, count), ("127.0.0.1", sensor.port))
    sensor.serve(now)


def received(client):
    found = []
    client.settimeout(0.05)
    try:
        while True:
            found.append(struct.unpack(">III6i", client.recv(64)))
    except TimeoutError:
        return found


def test_records_come_at_their_rate_and_count_up():
    """Counts of a millionth of a newton, and of a millionth of a newton metre."""
    with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as client:
        client.bind(("127.0.0.1", 0))
        wrong = Misbehaviour()
        sensor = ForceSensor(Plant(wrench=(1.5, -2.0, 0.25, 0.1, -0.2, 3.0)), 1000.0, wrong)
        assert sensor.next_due is None and not sensor.tick(10)
        asked(sensor, client, 2, 3, now=1_000_000)
        assert sensor.next_due == 1_000_000 and sensor.tick(3_500_000)
        first, second, third = received(client)
        assert [r[0] for r in (first, second, third)] == [1, 2, 3] and third[1] - first[1] == 2
        assert first[3:] == (1_500_000, -2_000_000, 250_000, 100_000, -200_000, 3_000_000)
        assert sensor.next_due is None, "three were asked for"
        asked(sensor, client, 0x42)
        asked(sensor, client, 2, 0, now=10_000_000)
        sensor.tick(11_000_000)
        assert [r[3:] for r in received(client)] == [(0,) * 6] * 2
        sensor.sign, wrong.ft_drop = -1, 1.0
        sensor.tick(12_000_000)
        assert received(client) == [] and sensor.gone == 1
        wrong.ft_drop = 0.0
        sensor.tick(13_000_000)
        ((sequence, *_, x, _, _, _, _, torque),) = received(client)
        assert sequence == 4 and (x, torque) == (-3_000_000, -6_000_000)
        asked(sensor, client, 0)
        assert sensor.next_due is None
        sensor.socket.close()


READ = bytes((0x63, 0x02, 15, 0))


@pytest.mark.parametrize(("kept", "left"), [(0, 0), (5, 5)])
def test_a_bench_keeps_no_more_than_it_is_asked_to(tmp_path, kept, left):
    """A bench that nobody could ask grew by 3.7 MB a minute."""
    args = argparse.Namespace(
        rig="paper_high_impedance", model=[54024], seed=0, torque_constant=0.0, return_delay=0,
        deflection=False, can=None,
    )
    _, motors = _motors(args, kept)
    bus = EmulatedBus(tmp_path / "tty", motors, Misbehaviour(), kept)
    for now in range(9):
        motors[0].write(now, 604, bytes(2))
        for request in bus._listener.hear(instruction(1, 2, READ)):
            bus._answer(now, request)
    bus.vanish()
    assert (len(motors[0].history), len(bus.sent)) == (left, left)
