"""A Dynamixel on its bus as a device, with an ATI Net F/T sensor, an encoder on the spring, or neither."""

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import replace

from rsea_ros.hardware.device import State, Wrench
from rsea_ros.hardware.dynamixel.encoder import BusEncoder, EncoderConnection, MotorSample, Unwrapper
from rsea_ros.hardware.dynamixel.motor import Motor
from rsea_ros.hardware.dynamixel.own_limits import check_own_limits
from rsea_ros.hardware.limits import Limits, Rating, check_limits
from rsea_ros.hardware.netft.sensor import ForceTorqueSensor, SensorConnection
from rsea_ros.hardware.protection import Protection


class DynamixelNetft:
    """Motor and sensor behind the Device interface.

    Angles count from where the drive stands when the device is opened: torque off, the spring at rest.
    absolute: they count from the motor's own zero instead, its encoder's with its homing offset.
    motor: alone on its port, or a LineMotor. encoder: of the spring, on the same port.
    stiffness: of the rig's spring, N m/rad, which the limits are checked against.
    """

    def __init__(
        self,
        motor: Motor,
        sensor: SensorConnection | None,
        limits: Limits,
        stiffness: float,
        *,
        absolute: bool = False,
        encoder: EncoderConnection | None = None,
    ) -> None:
        self._motor = motor
        self._encoder = BusEncoder(encoder, motor.port) if encoder is not None else None
        self._sensor = ForceTorqueSensor(sensor) if sensor is not None else None
        self._limits, self._stiffness, self._absolute = limits, stiffness, absolute
        self._epoch = 0
        self.origin, self._counts = 0.0, Unwrapper()
        self._waiting: list[tuple[int, Wrench]] = []
        self._trouble = ""
        self._last: State | None = None

    @property
    def protection(self) -> Protection:
        """The motor's."""
        return self._motor.protection

    @property
    def rating(self) -> Rating:
        """The motor's own limits, its speed without load, and the range of the sensor."""
        felt = math.inf if self._sensor is None else self._sensor.range[self._limits.ft_axis]
        own, motor = self._motor.limits, self._motor
        assert own is not None
        supply = own.lowest_voltage, own.highest_voltage
        return Rating(motor.torque_limit, motor.control_table.no_load_speed, felt, own.current, *supply)

    def open(self) -> None:
        """Connect to both and check the limits. Raises DeviceError, ParameterError; nothing stays open."""
        self._epoch = time.time_ns() - time.monotonic_ns()
        try:
            self._motor.open()
            check_limits(self._limits, self._motor.torque_limit, self._stiffness)
            assert self._motor.limits is not None
            check_own_limits(self._limits, self._motor.limits, self._motor.control_table.name)
            self._counts.restart()
            sample = self._motor.bus.patiently(self._read_motor)
            self.origin = 0.0 if self._absolute else sample.position
            if self._encoder is not None:
                self._encoder.open(sample, absolute=self._absolute)
            if self._sensor is not None:
                self._sensor.open()
        except Exception:
            self.close()
            raise

    def enable(self) -> None:
        """Switch the torque on, at zero."""
        self._motor.enable()

    def read(self) -> State:
        """Return one synchronous sample of the motor with the newest wrench. Raises DeviceError.

        The sensor's socket is emptied while the motor answers, and of the rest after that.
        """
        try:
            sample = self._read_motor(self._sensor.gather if self._sensor is not None else None)
            deflection = math.nan if self._encoder is None else self._encoder.deflection(sample)
        finally:
            self._take_wrenches()
        wrenches, trouble, self._waiting, self._trouble = self._waiting, self._trouble, [], ""
        stamp, wrench = wrenches[-1] if wrenches else (0, None)
        self._last = State(
            stamp=sample.instant + self._epoch,
            position=sample.position - self.origin,
            velocity=sample.velocity,
            motor_torque=self._motor.torque_of(sample.current),
            ft_stamp=stamp,
            wrench=wrench,
            wrenches=wrenches,
            current=sample.current,
            voltage=sample.voltage,
            temperature=sample.temperature,
            hardware_error=sample.hardware_error,
            ft_trouble=trouble,
            motor_trouble=sample.trouble,
            deflection=deflection,
            acknowledged_late=self._motor.acknowledged_late,
        )
        return self._last

    def _read_motor(self, meanwhile: Callable[[], None] | None = None) -> MotorSample:
        """Return a sample whose position goes on where the motor's counts wrap round."""
        sample = self._motor.read(meanwhile)
        turn = 2.0 * math.pi / self._motor.control_table.pulses
        return replace(sample, position=self._counts.take(sample.counts) * turn)

    def _take_wrenches(self) -> None:
        """Keep the sensor's wrenches until a reading includes them, also after a lost reply."""
        if self._sensor is None:
            return
        wrenches, trouble = self._sensor.take()
        self._waiting += [(instant + self._epoch, wrench) for instant, wrench in wrenches]
        self._trouble = self._trouble or trouble

    def write(self, torque: float) -> None:
        """Command a torque (N m)."""
        self._motor.write(torque)

    def disable(self) -> None:
        """Command zero torque and switch it off."""
        self._motor.disable()

    def zero_ft(self) -> None:
        """Tare the sensor."""
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
        values: dict[str, object] = {f"bus_{kind}": n for kind, n in self._motor.bus.errors.items()}
        limits = self._motor.limits
        if self._motor.table is not None and limits is not None:
            values |= {
                "motor": self._motor.table.name,
                "firmware": limits.firmware,
                "torque_limit_nm": f"{self._motor.torque_limit:.4g}",
                "torque_constant": self._motor.torque_constant,
                "homing_offset_rad": f"{limits.homing_offset:.6g}",
                "reversed": limits.reversed,
            }
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
        """Zero torque, off, everything closed."""
        try:
            self._motor.close()
        finally:
            if self._sensor is not None:
                self._sensor.close()
