"""A motor of a line: its goal and its sample go through the line's exchange, all else it does by itself."""

from __future__ import annotations

from collections.abc import Callable

from rsea_ros.errors import DeviceError
from rsea_ros.hardware.device import PortLost
from rsea_ros.hardware.dynamixel.bus import ALERT
from rsea_ros.hardware.dynamixel.line import Line
from rsea_ros.hardware.dynamixel.motor import Motor
from rsea_ros.hardware.dynamixel.sample import MotorSample
from rsea_ros.hardware.dynamixel.settings import MotorConnection


class LineMotor(Motor):
    """As Motor. The exchange comes between `write` and `read`; without one `read` asks the motor alone."""

    def __init__(self, settings: MotorConnection, line: Line) -> None:
        super().__init__(settings, line.port)
        self._line, self._id = line, settings.identity

    def _set_up(self) -> None:
        """Join the line and be set up, torque off. Raises DeviceError, also for a motor of another series."""
        self._line.join(self._id, self.close)
        super()._set_up()
        self._line.admit(self._id, self.control_table, self.bus.return_delay)

    def read(self, meanwhile: Callable[[], None] | None = None) -> MotorSample:
        """Return the reading of the exchange, or a separate one. Raises NoReply, PortLost, Refused."""
        if not self._line.has_read(self._id):
            return super().read(meanwhile)
        if meanwhile is not None:
            meanwhile()
        answer = self._line.answer(self._id)
        self.bus.alert = bool(answer.error & ALERT)
        return self.sample(answer.data, answer.instant)

    def write(self, torque: float) -> None:
        """Set the goal (N m) that the next exchange writes. Raises PortLost."""
        self._line.set_goal(self._id, self.counts(torque))

    def recover(self) -> None:
        """Reconnect; where the port was lost, every motor of the line must be recovered."""
        try:
            self.bus.patiently(self.bus.ping)
        except PortLost:
            self._line.give_up()
        except DeviceError:
            pass  # a fault of this motor alone is handled below
        super().recover()

    def close(self) -> None:
        """Zero torque, off; the last motor of the line closes the port."""
        super().close()
        self._line.leave(self._id)
