"""The serial port on a pseudo-terminal: bytes are read whole, once, and not after they were discarded."""

import os
import time
import tty
from contextlib import suppress

import pytest

from rsea_ros.hardware.device import PortLost
from rsea_ros.hardware.dynamixel.port import SerialPort


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


def test_a_reply_in_pieces_is_read_whole(wire):
    port, near = wire
    for piece in (b"ab", b"cde", b"f"):
        os.write(near, piece)
        assert receive_all(port, len(piece)) == piece


def test_without_a_reply_nothing_is_returned_after_the_time_out(wire):
    port, _ = wire
    port.setPacketTimeoutMillis(2.0)
    assert port.receive() == b"" and port.isPacketTimeout() and port.time_left == 0.0


def test_bytes_that_came_before_are_discarded(wire):
    port, near = wire
    os.write(near, b"older")
    time.sleep(0.05)
    port.clearPort()
    os.write(near, b"new")
    assert receive_all(port, 3) == b"new"


def test_a_port_that_hangs_up_is_lost(wire):
    port, near = wire
    os.close(near)
    with pytest.raises(PortLost):
        port.writePort(b"x")
