"""A motor on its bus as a device, with an ATI Net F/T sensor, an encoder on the spring, or neither."""

import math
import time
from collections.abc import Mapping
from dataclasses import replace

from rsea_ros.hardware.bus_motor import BusMotor
from rsea_ros.hardware.device import State, Wrench
from rsea_ros.hardware.dynamixel.encoder import BusEncoder
from rsea_ros.hardware.limits import Limits, Rating, check_limits
from rsea_ros.hardware.netft.sensor import ForceTorqueSensor, SensorConnection
from rsea_ros.hardware.protection import Protection

ZEROS = CONFIGURE, MOTOR, ROBOTIS = "configure", "motor", "robotis"
"""Where angles are zero."""


class MotorNetft:
    """Motor and sensor behind the Device interface.

    Angles count from where the drive stands when the device is opened: torque off, the spring at rest.
    zero: "motor": they count from the motor's own zero instead, its encoder's with its homing offset, and the
    deflection from that of the spring's encoder; another: the motor knows which zero, for its angle alone.
    motor: alone on its port, or one of several. encoder: of the spring, on the port of a Dynamixel.
    stiffness: of the rig's spring, N m/rad, which the limits are checked against.
    """

    def __init__(
        self,
        motor: BusMotor,
        sensor: SensorConnection | None,
        limits: Limits,
        stiffness: float,
        *,
        zero: str = CONFIGURE,
        encoder: BusEncoder | None = None,
    ) -> None:
        self._motor = motor
        self._encoder = encoder
        self._sensor = ForceTorqueSensor(sensor) if sensor is not None else None
        self._limits, self._stiffness, self._zero = limits, stiffness, zero
        self._epoch, self.origin = 0, 0.0
        self._waiting: list[tuple[int, Wrench]] = []
        self._trouble = ""
        self._last: State | None = None

    @property
    def protection(self) -> Protection:
        return self._motor.protection

    @property
    def rating(self) -> Rating:
        """The motor's own limits, and the range of the sensor."""
        if self._sensor is None:
            return self._motor.rating
        return replace(self._motor.rating, ft=self._sensor.range[self._limits.ft_axis])

    def open(self) -> None:
        """Connect to both and check the limits. Raises DeviceError, ParameterError; nothing stays open."""
        self._epoch = time.time_ns() - time.monotonic_ns()
        try:
            self._motor.open()
            check_limits(self._limits, self._motor.torque_limit, self._stiffness)
            self._motor.check(self._limits)
            sample = self._motor.patiently(self._motor.read)
            self.origin = sample.position if self._zero == CONFIGURE else 0.0
            if self._encoder is not None:
                self._encoder.open(sample, absolute=self._zero == MOTOR)
            if self._sensor is not None:
                self._sensor.open()
        except Exception:
            self.close()
            raise

    def enable(self) -> None:
        self._motor.enable()

    def read(self) -> State:
        """Return one synchronous sample of the motor with the newest wrench. Raises DeviceError.

        The sensor's socket is emptied while the motor answers, and of the rest after that.
        """
        try:
            sample = self._motor.read(self._sensor.gather if self._sensor is not None else None)
            deflection = math.nan if self._encoder is None else self._encoder.deflection(sample)
        finally:
            self._take_wrenches()
        wrenches, trouble, self._waiting, self._trouble = self._waiting, self._trouble, [], ""
        stamp, wrench = wrenches[-1] if wrenches else (0, None)
        self._last = replace(
            sample,
            stamp=sample.stamp + self._epoch,
            position=sample.position - self.origin,
            ft_stamp=stamp,
            wrench=wrench,
            wrenches=wrenches,
            ft_trouble=trouble,
            deflection=deflection,
            acknowledged_late=self._motor.acknowledged_late,
        )
        return self._last

    def _take_wrenches(self) -> None:
        """Keep the sensor's wrenches until a reading includes them, also after a lost reply."""
        if self._sensor is None:
            return
        wrenches, trouble = self._sensor.take()
        self._waiting += [(instant + self._epoch, wrench) for instant, wrench in wrenches]
        self._trouble = self._trouble or trouble

    def write(self, torque: float) -> None:
        self._motor.write(torque)

    def disable(self) -> None:
        self._motor.disable()

    def zero_ft(self) -> None:
        if self._sensor is not None:
            self._sensor.zero()

    def recover(self) -> None:
        """Connect again; raises DeviceError while motor or sensor still complain."""
        self._motor.recover()
        self._recover_sensor()

    def reboot(self) -> None:
        """Reboot the motor, then see to the sensor."""
        self._motor.reboot()
        self._recover_sensor()

    def _recover_sensor(self) -> None:
        """Wait for the sensor; errors in earlier records no longer count."""
        if self._sensor is not None:
            self._sensor.recover()
            self._take_wrenches()
            self._trouble = ""

    def health(self) -> Mapping[str, object]:
        """Return errors of bus and stream by kind, and the motor's last report."""
        values = dict(self._motor.health())
        if self._encoder is not None:
            values |= {f"encoder_{kind}": n for kind, n in self._encoder.errors.items()}
        if self._sensor is not None:
            values |= {f"ft_{kind}": n for kind, n in self._sensor.counts().items()}
            values["ft_low_pass"] = self._sensor.low_pass or "not stated"
            values["ft_noise_nm"] = f"{self._sensor.noise[5]:.3g}"
        if self._last is not None:
            values |= {"temperature_c": self._last.temperature, "voltage_v": f"{self._last.voltage:.1f}"}
            values["hardware_error"] = self._last.hardware_error or "none"
        return values

    def close(self) -> None:
        try:
            self._motor.close()
        finally:
            if self._sensor is not None:
                self._sensor.close()
