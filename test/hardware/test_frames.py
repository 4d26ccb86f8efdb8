"""Protocol 2.0 and its port: the maker's vectors, another codec, damage, bytes on a pseudo-terminal."""

import itertools
import os
import random
import select
import time
import tty
from collections import Counter
from contextlib import suppress

import pytest

from rsea_ros.hardware.device import NoReply, PortLost
from rsea_ros.hardware.dynamixel.bus import Bus, PacketHandler, SerialPort, Turns
from rsea_ros.hardware.dynamixel.control_tables import TABLES, MotorConnection, TorqueConstant
from rsea_ros.hardware.dynamixel.frames import StatusFrameParser, frame, stuff, unstuff
from rsea_ros.hardware.dynamixel.motor import Motor
from rsea_ros.hardware.peer import serial_line as protocol2
from rsea_ros.hardware.peer.serial_line import status

ALPHABET = (0xFF, 0xFD, 0x00, 0x55)
VECTORS = {
    "ping ID 1": (1, "01", "19 4e"),
    "read ID 1, address 0x84, length 4": (1, "02 84 00 04 00", "1d 15"),
    "reboot ID 1": (1, "08", "2f 4e"),
    "ping status, model 1030, firmware 38": (1, "55 00 06 04 26", "65 5d"),
    "sync read 0x84, 4, IDs 1 and 2": (254, "82 84 00 04 00 01 02", "ce fa"),
    "empty status ID 1": (1, "55 00", "a1 0c"),
}


@pytest.mark.parametrize("name", VECTORS)
def test_the_makers_test_vectors_are_reproduced(name):
    identity, payload, crc = VECTORS[name]
    packet = frame(identity, bytes.fromhex(payload))
    assert packet[-2:] == bytes.fromhex(crc)
    assert packet[7:-2] == bytes.fromhex(payload)
    updated = PacketHandler().updateCRC(0, list(packet), len(packet) - 2)
    assert updated == int.from_bytes(packet[-2:], "little")


def short_payloads():
    """Yield every payload of up to 7 of the bytes that stuffing treats."""
    for length in range(8):
        yield from map(bytes, itertools.product(ALPHABET, repeat=length))


def test_stuffing_is_undone_for_every_short_payload_and_holds_no_header():
    for payload in short_payloads():
        packed = stuff(payload)
        assert unstuff(packed) == payload
        assert packed == protocol2.escape(payload) and protocol2.unescape(packed) == payload
        assert b"\xff\xff\xfd\x00" not in packed


def test_impossible_stuffing_is_refused_by_both_codecs():
    for payload in short_payloads():
        assert (unstuff(payload) is None) == (protocol2.unescape(payload) is None)


def test_the_sdks_methods_invert_each_other_where_its_own_lose_a_byte():
    handler = PacketHandler()
    for payload in (b"\x03\xff\xff\xfd\xff\xfd\xfd", b"\x03\xff\xff\xfd", b"\x03\xff\xff\xfd\xfd\x00"):
        packet = [0xFF, 0xFF, 0xFD, 0, 1, len(payload) + 2, 0, *payload, 0, 0]
        assert handler.removeStuffing(handler.addStuffing(packet)) == packet
    with pytest.raises(ValueError, match="FF FF FD inside"):
        handler.removeStuffing([0xFF, 0xFF, 0xFD, 0, 1, 6, 0, 0x55, 0xFF, 0xFF, 0xFD, 0, 0])


def test_every_short_payload_comes_through_the_receiver_byte_by_byte_and_at_once():
    receiver = StatusFrameParser()
    for payload in itertools.islice(short_payloads(), 0, None, 7):
        packet = protocol2.status(1, 0, payload)
        (whole,) = receiver.feed(packet)
        assert whole[9:-2] == payload
        pieces = [receiver.feed(packet[i : i + 1]) for i in range(len(packet))]
        assert pieces[:-1] == [[]] * (len(packet) - 1) and pieces[-1] == [whole]
    assert not receiver.rejected


def test_unstuffed_bytes_with_a_right_crc_are_refused_and_counted():
    receiver = StatusFrameParser()
    assert receiver.feed(protocol2.status(1, 0, b"\xff\xff\xfd\x07", escaped=False)) == []
    assert receiver.rejected["stuffing"] == 1


def test_the_frame_behind_a_damaged_one_is_found():
    good = protocol2.status(1, 0, b"\x01\x02")
    endless = b"\xff\xff\xfd\x00\x01\xff\xff"
    for damage in (b"\xff\xff\xfd", good[:5], b"\xff" * 5, good[:-1] + b"\x00", endless):
        assert StatusFrameParser().feed(damage + good)[-1:] == [good], damage.hex(" ")


def mutations(rng, packet):
    """Yield damage that a CRC of 16 bits detects: a burst of up to 16 bits, a frame cut short, random bytes.

    The burst lies before or in the CRC: across its border it is none, as the CRC's low byte comes first.
    """
    burst, at = rng.randrange(1, 1 << 16), rng.choice([*range(len(packet) - 3), len(packet) - 2])
    flipped = int.from_bytes(packet[at : at + 2], "big") ^ burst
    yield packet[:at] + flipped.to_bytes(2, "big") + packet[at + 2 :]
    yield packet[: rng.randrange(len(packet))]
    yield rng.randbytes(rng.randrange(40))
    yield packet[rng.randrange(1, len(packet)) :]


def test_damaged_and_random_bytes_give_no_frame_that_was_not_sent():
    rng, strings = random.Random(4), 0
    while strings < 10_000:
        packet = protocol2.status(rng.randrange(253), rng.randrange(8), rng.randbytes(rng.randrange(20)))
        for damaged in mutations(rng, packet):
            assert StatusFrameParser().feed(damaged) in ([], [packet]), damaged.hex(" ")
            strings += 1


@pytest.fixture
def wire():
    """An open port and the descriptor of its other end."""
    near, far = os.openpty()
    tty.setraw(far)
    port = SerialPort(os.ttyname(far), 1_000_000, 1e-3)
    port.open()
    os.close(far)
    yield port, near
    port.close()
    with suppress(OSError):  # the test may have closed it
        os.close(near)


def receive_all(port, size):
    """Everything until so many bytes have come."""
    data, deadline = b"", time.monotonic() + 10.0
    while len(data) < size and time.monotonic() < deadline:
        port.setPacketTimeoutMillis(100.0)
        data += port.receive()
    return data


@pytest.mark.parametrize("size", [1, 64, 65, 4000])
def test_a_reply_is_read_whole(wire, size):
    port, near = wire
    for fill in range(3):
        reply = bytes((k + fill) % 251 for k in range(size))
        os.write(near, reply)
        assert receive_all(port, size) == reply


def test_without_a_reply_nothing_is_returned_after_the_time_out(wire):
    port, _ = wire
    port.setPacketTimeoutMillis(2.0)
    assert port.receive() == b"" and port.isPacketTimeout() and port.time_left == 0.0


def test_bytes_that_came_before_are_discarded(wire):
    port, near = wire
    os.write(near, b"older")
    assert select.select([port.descriptor], [], [], 10.0)[0], "they have come"
    port.clearPort()
    os.write(near, b"new")
    assert receive_all(port, 3) == b"new"


def test_a_port_that_hangs_up_is_lost(wire):
    port, near = wire
    os.close(near)
    with pytest.raises(PortLost):
        port.writePort(b"x")


SIZE = TABLES[54024].sample[1]
WRITTEN, READ = status(1, 0), status(1, 0, bytes(SIZE))


class Line:
    """A port that has the replies of each request ready, in order; a request without any times out."""

    def __init__(self, *replies):
        self.replies, self.waiting = [list(r) for r in replies], []
        self.port_name, self.is_using, self.turns = "line", False, Turns()
        self.latency = self.return_delay = self.time_left = 0.0
        self.baudrate = 1_000_000

    def clearPort(self):
        self.waiting = []

    def writePort(self, packet):
        self.waiting = self.replies.pop(0)
        return len(packet)

    def receive(self):
        return self.waiting.pop(0) if self.waiting else b""

    def isPacketTimeout(self):
        return not self.waiting

    def setPacketTimeout(self, length):
        """Take no time."""

    setPacketTimeoutMillis = setPacketTimeout


def motor_on(line):
    """An open 54024 there."""
    motor = Motor(MotorConnection("line"))
    motor.port, motor.bus, motor.table = line, Bus(line, 1), TABLES[54024]
    motor.torque_constant = TorqueConstant(6.8, 6.8, 6.8, "")
    return motor


@pytest.mark.parametrize(
    ("during_write", "during_read", "late"),
    [([], [WRITTEN, READ], True), ([], [READ], False), ([WRITTEN], [READ], False),
     ([WRITTEN], [WRITTEN, READ], False)],
)  # fmt: skip
def test_a_reply_during_the_reading_is_a_late_acknowledgement(during_write, during_read, late):
    motor = motor_on(Line(during_write, during_read, [WRITTEN], [READ]))
    with suppress(NoReply):
        motor.write(1.0)
    begun = time.monotonic_ns()
    assert motor.read().stamp >= begun and motor.acknowledged_late is late
    counted = {"lost": not during_write, "stale": during_read.count(WRITTEN)}
    assert motor.bus.errors == Counter(counted)
    motor.write(1.0)
    motor.read()
    assert motor.acknowledged_late is False
