"""A reply to a write that comes while the motor is read shows that the motor has obeyed."""

import time
from contextlib import suppress

import pytest

from rsea_ros.hardware.device import NoReply
from rsea_ros.hardware.dynamixel.bus import Bus
from rsea_ros.hardware.dynamixel.control_tables import TABLES, MotorConnection, TorqueConstant
from rsea_ros.hardware.dynamixel.motor import Motor
from rsea_ros.hardware.dynamixel.port import Turns
from rsea_ros.hardware.peer.protocol2 import status

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
        """Discard what is left."""
        self.waiting = []

    def writePort(self, packet):
        """Take a request."""
        self.waiting = self.replies.pop(0)
        return len(packet)

    def receive(self):
        """The next reply."""
        return self.waiting.pop(0) if self.waiting else b""

    def isPacketTimeout(self):
        """Without more replies."""
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
    assert motor.read().instant >= begun and motor.acknowledged_late is late
    motor.write(1.0)
    motor.read()
    assert motor.acknowledged_late is False
