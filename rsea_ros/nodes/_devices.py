"""What the driver can drive: parameters to a device and its limits."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from rsea_ros.errors import ParameterError
from rsea_ros.hardware.device import Device
from rsea_ros.hardware.dynamixel.motor import Settings as MotorSettings
from rsea_ros.hardware.dynamixel.motor import usual_latency
from rsea_ros.hardware.dynamixel.port import BAUD_RATES
from rsea_ros.hardware.dynamixel.tables import TABLES
from rsea_ros.hardware.dynamixel_netft import DynamixelNetft
from rsea_ros.hardware.limits import Limits
from rsea_ros.hardware.netft.sensor import Settings as SensorSettings
from rsea_ros.hardware.simulated import SimulatedDevice
from rsea_ros.model.rig import END_NAMES
from rsea_ros.model.rig_file import load_rig
from rsea_ros.nodes._parameters import Parameter

Values = Mapping[str, Any]

KNOWN = ", ".join(map(str, TABLES))
MOTOR = (
    Parameter("port", "/dev/ttyUSB0", "serial port of the motor"),
    Parameter("baud", 1_000_000, "of the serial port, as the motor is set", "bit/s", 9600, 10_500_000),
    Parameter("id", 1, "of the motor on its bus", "", 0, 252),
    Parameter("model", 0, f"number that the motor must have: {KNOWN}; 0: any of them", "", 0, 65535),
    Parameter("torque_constant", 6.826, "torque at the gear output for a current", "N m/A", 0.1, 100.0),
    Parameter(
        "latency", 0.0, "what adapter and host may add to a reply; 0: by the rate, docs/hardware.md", "s",
        0.0, 0.1,
    ),
    Parameter("watchdog", 0.1, "time without the driver after which the motor is stopped", "s", 0.02, 2.5),
)
SENSOR = (
    Parameter("ft_host", "192.168.1.1", "address of the F/T sensor; empty: there is none"),
    Parameter("ft_port", 49152, "UDP port of its stream", "", 1, 65535),
    Parameter("ft_page_port", 80, "TCP port of its web page", "", 1, 65535),
    Parameter("ft_timeout", 0.01, "time without a record that is a fault", "s", 0.001, 1.0),
    Parameter("ft_all", False, "whether ft has every record, or one a cycle"),
)
LIMITS = (
    Parameter("torque_limit", 68.0, "largest torque that is commanded", "N m", 0.0, 1000.0),
    Parameter("slew_limit", 40_000.0, "largest change of torque in a second", "N m/s", 1.0, 1e6),
    Parameter("deflection_limit", 0.0873, "of the spring, where both ends are clamped", "rad", 0.0, 100.0),
    Parameter("temperature_limit", 70.0, "of the motor", "°C", 0.0, 100.0),
    Parameter("current_limit", 12.0, "of the motor, measured", "A", 0.0, 100.0),
    Parameter("voltage_limit", 20.0, "lowest supply voltage", "V", 0.0, 100.0),
    Parameter("command_timeout", 0.05, "time without a command that ends the torque", "s", 0.001, 10.0),
    Parameter("ramp", 0.02, "from there to zero torque", "s", 0.0, 10.0),
    Parameter("lost_cycles", 3, "cycles in a row without an answer that are a fault", "", 1, 100),
)


def limits_of(values: Values) -> Limits:
    """Return the limits that the parameters set; the drive's angle is the spring's between clamped ends."""
    rig = load_rig(values["rig"])
    deflects = rig.clamped == set(END_NAMES) and not rig.rigid_spring
    return Limits(
        torque=values["torque_limit"],
        slew=values["slew_limit"],
        deflection=values["deflection_limit"] if deflects else math.inf,
        temperature=values["temperature_limit"],
        current=values["current_limit"],
        voltage=values["voltage_limit"],
        command_timeout=values["command_timeout"],
        ramp=values["ramp"],
        lost_cycles=values["lost_cycles"],
    )


def _simulated(values: Values) -> Device:
    return SimulatedDevice(load_rig(values["rig"]), values["rate"], seed=values["seed"])


def _dynamixel_netft(values: Values) -> Device:
    rig = load_rig(values["rig"])
    if values["baud"] not in BAUD_RATES:
        known = ", ".join(map(str, BAUD_RATES))
        raise ParameterError(f"parameter baud = {values['baud']} bit/s, expected one of {known}")
    motor = MotorSettings(
        path=values["port"],
        baud=values["baud"],
        identity=values["id"],
        model=values["model"],
        torque_constant=values["torque_constant"],
        latency=values["latency"] or usual_latency(values["rate"]),
        watchdog=values["watchdog"],
    )
    sensor = SensorSettings(*(values[f"ft_{name}"] for name in ("host", "port", "page_port", "timeout")))
    stiffness = math.inf if rig.rigid_spring else rig["spring.stiffness"]
    return DynamixelNetft(motor, sensor if values["ft_host"] else None, limits_of(values), stiffness)


DEVICES: Mapping[str, Callable[[Values], Device]] = {
    "simulated": _simulated,
    "dynamixel_netft": _dynamixel_netft,
}
