"""What the driver can drive: parameters to a device and its limits."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from msg_adapters.topics import sign_and_index
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
from rsea_ros.model.rig import END_NAMES, Rig
from rsea_ros.model.rig_file import load_rig
from rsea_ros.nodes._parameters import AXIS, Parameter

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
    Parameter("supervisor", "", "socket of a supervisor that runs as a service; empty: a child process"),
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
    Parameter("slew_limit", 10_000.0, "largest change of torque in a second", "N m/s", 1.0, 1e6),
    Parameter("soft_start", 500.0, "growth of the limit after activation, fault, pause", "N m/s", 1.0, 1e6),
    Parameter("deflection_limit", 0.0873, "of the spring; 0: none", "rad", 0.0, 100.0),
    Parameter("velocity_limit", 5.0, "of the gear output; 0: none", "rad/s", 0.0, 1000.0),
    Parameter("position_limit", 0.0, "either way from where configure finds it; 0: none", "rad", 0.0, 1e4),
    Parameter("ft_limit", 110.0, "of the torque that ft measures; 0: none", "N m", 0.0, 1000.0),
    Parameter("power_limit", 250.0, "of the motor torque times velocity; 0: none", "W", 0.0, 1e5),
    Parameter("effort_limit", 6.0, "by which measured may miss commanded; 0: none", "N m", 0.0, 1000.0),
    Parameter("effort_time", 0.1, "for which it may", "s", 0.0, 10.0),
    Parameter("temperature_limit", 70.0, "of the motor", "°C", 0.0, 100.0),
    Parameter("current_limit", 12.0, "of the motor, measured", "A", 0.0, 100.0),
    Parameter("voltage_limit", 20.0, "lowest supply voltage", "V", 0.0, 100.0),
    Parameter("command_timeout", 0.05, "time without a command that ends the torque", "s", 0.001, 10.0),
    Parameter("ramp", 0.02, "from there to zero torque", "s", 0.0, 10.0),
    Parameter("lost_cycles", 3, "cycles in a row without an answer that are a fault", "", 1, 100),
    AXIS,
)


def limits_of(values: Values) -> Limits:
    """Return the limits that the parameters set. Raises ParameterError for one that cannot be applied.

    The drive's angle is the spring's between clamped ends; with a free end what ft measures is.
    """
    rig = load_rig(values["rig"])
    _check_applicable(values, rig)
    clamped = rig.clamped == set(END_NAMES)
    deflection, ft = (values[f"{name}_limit"] or math.inf for name in ("deflection", "ft"))
    if not clamped and not rig.rigid_spring:
        ft = min(ft, deflection * rig["spring.stiffness"])
    return Limits(
        torque=values["torque_limit"],
        slew=values["slew_limit"],
        deflection=deflection if clamped else math.inf,
        temperature=values["temperature_limit"],
        current=values["current_limit"],
        voltage=values["voltage_limit"],
        command_timeout=values["command_timeout"],
        ramp=values["ramp"],
        lost_cycles=values["lost_cycles"],
        velocity=values["velocity_limit"] or math.inf,
        position=values["position_limit"] or math.inf,
        ft=ft,
        power=values["power_limit"] or math.inf,
        soft_start=values["soft_start"],
        effort=values["effort_limit"] or math.inf,
        effort_time=values["effort_time"],
        ft_axis=sign_and_index(values["axis"])[1],
    )


def _check_applicable(values: Values, rig: Rig) -> None:
    """Raise ParameterError for a limit of what this bench does not measure."""
    feels = not rig.rigid_spring and (values["device"] == "simulated" or bool(values["ft_host"]))
    clamped = rig.clamped == set(END_NAMES)
    why = "its spring is rigid" if rig.rigid_spring else "ft_host is empty: no F/T sensor measures it"
    for name, applicable in (("deflection", feels or (clamped and not rig.rigid_spring)), ("ft", feels)):
        if values[f"{name}_limit"] and not applicable:
            raise ParameterError(
                f"parameter {name}_limit = {values[f'{name}_limit']:g} cannot be applied to rig {rig.name}"
                f" ({why}), expected 0 for none"
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
        supervisor=values["supervisor"],
    )
    sensor = SensorSettings(*(values[f"ft_{name}"] for name in ("host", "port", "page_port", "timeout")))
    stiffness = math.inf if rig.rigid_spring else rig["spring.stiffness"]
    return DynamixelNetft(motor, sensor if values["ft_host"] else None, limits_of(values), stiffness)


DEVICES: Mapping[str, Callable[[Values], Device]] = {
    "simulated": _simulated,
    "dynamixel_netft": _dynamixel_netft,
}
