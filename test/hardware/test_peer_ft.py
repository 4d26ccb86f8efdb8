"""What the simulated bench does to replies, and the records that its F/T sensor sends."""

from __future__ import annotations

import socket
import struct
from contextlib import closing

import pytest

from rsea_ros.hardware.device import State
from rsea_ros.hardware.peer.ft import ForceSensor, Misbehaviour

PACKET = bytes(range(100, 130))


@pytest.mark.parametrize("kind", ["silent", "drop"])
def test_a_silent_motor_and_a_dropped_reply_are_nothing(kind: str) -> None:
    wrong = Misbehaviour(**{kind: True if kind == "silent" else 1.0})
    assert wrong.damage(PACKET) == b"" and wrong.done == {kind: 1}


def test_each_damage_changes_what_it_says() -> None:
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


def test_a_share_is_that_of_the_replies_and_counted() -> None:
    wrong = Misbehaviour(drop=0.25, seed=3)
    lost = sum(wrong.damage(PACKET) == b"" for _ in range(4000))
    assert lost == wrong.done["drop"] == pytest.approx(1000, abs=90)


class Plant:
    wrench = (1.5, -2.0, 0.25, 0.1, -0.2, 3.0)

    def read(self) -> State:
        return State(0, 0.0, 0.0, 0.0, 0, self.wrench)

    def write(self, torque: float) -> None:
        pass


def asked(sensor: ForceSensor, client: socket.socket, command: int, count: int = 0, now: int = 0) -> None:
    client.sendto(struct.pack(">HHI", 0x1234, command, count), ("127.0.0.1", sensor.port))
    sensor.serve(now)


def received(client: socket.socket) -> list[tuple[int, ...]]:
    found = []
    client.settimeout(0.05)
    try:
        while True:
            found.append(struct.unpack(">III6i", client.recv(64)))
    except TimeoutError:
        return found


def test_records_come_at_their_rate_and_count_up() -> None:
    """Counts of a millionth of a newton, and of a millionth of a newton metre."""
    with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as client:
        client.bind(("127.0.0.1", 0))
        wrong = Misbehaviour()
        sensor = ForceSensor(Plant(), 1000.0, wrong)
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
