"""Parameters of devices, and the buses that joints share."""

import math
from collections.abc import Callable, Mapping, Sequence

from rsea_ros.errors import ParameterError
from rsea_ros.hardware.device import Device
from rsea_ros.hardware.dynamixel.encoder import LINK, SPRING
from rsea_ros.hardware.dynamixel.line import Line
from rsea_ros.hardware.motor_netft import ZEROS
from rsea_ros.model.rig_limits import POWER, SLEW
from rsea_ros.nodes._devices import CAN, DYNAMIXEL, Values, device_of, dynamixel_netft, latency_of
from rsea_ros.nodes._parameters import AXIS, DERIVED, NodeParameter

MOTOR = (
    NodeParameter("port", "/dev/ttyUSB0", "serial port of the motor, or CAN channel, such as can0"),
    NodeParameter("baud", 1_000_000, "of port or CAN bus, as the motor is set", "bit/s", 9600, 10_500_000),
    NodeParameter("fast_sync", False, "whether several motors on a port answer in one packet"),
    NodeParameter("id", 1, "of the motor on its bus", "", 0, 252),
    NodeParameter(
        "model", 0, "number that the motor must have (docs/hardware.md); 0: any that is known", "", 0, 65535
    ),
    NodeParameter("can_model", "", "of the drive of mit_can (docs/devices.md), or a YAML file of its ranges"),
    NodeParameter("can_interface", "socketcan", "of python-can, such as socketcan, slcan, virtual"),
    NodeParameter("can_host", -1, "identifier of the drive's replies; -1: its family's", "", -1, 2047),
    NodeParameter("torque_constant", 0.0,
                  "torque at the gear output for a current; 0: that of the model's table",
                  "N m/A", 0.0, 100.0),
    NodeParameter("position_zero", ZEROS[0], choices=ZEROS,
                  description="where angles are zero: where configure finds it, the motor's own zero, or"
                  " that of ROBOTIS's URDFs"),
    NodeParameter("latency", 0.0,
                  "what adapter and host may add to a reply; 0: by the rate, docs/hardware.md",
                  "s", 0.0, 0.1),
    NodeParameter("watchdog", 0.1,
                  "time without the driver after which the motor is stopped", "s", 0.02, 2.5),
    NodeParameter("supervisor", "", "socket of a supervisor that runs as a service; empty: a child process"),
)  # fmt: skip
ENCODER = (
    NodeParameter("encoder_id", -1, "of an encoder on the motor's bus that measures the spring; -1: none",
                  "", -1, 252),
    NodeParameter("encoder_address", 132, "of its angle, 4 bytes, signed", "", 0, 65535),
    NodeParameter("encoder_pulses", 4096.0, "counts of a turn; negative: they fall as the angle grows",
                  "", -1e9, 1e9),
    NodeParameter("encoder_place", SPRING,
                  "what it measures: the spring's deflection, or the link relative to the housing",
                  choices=(SPRING, LINK)),
)  # fmt: skip
SAFETY = (
    NodeParameter(
        "allow_no_dead_host_protection", False,
        "whether a device is driven whose torque nothing ends when this process dies",
    ),
    NodeParameter(
        "allow_no_position_limit", False, "whether a free end is activated without a position_limit"
    ),
    NodeParameter("device_options", "", "of a device of RSEA_DEVICES: NAME=VALUE,…"),
)  # fmt: skip
"""Of every device."""
SENSOR = (
    NodeParameter("ft_host", "192.168.1.1", "address of the F/T sensor; empty: there is none"),
    NodeParameter("ft_port", 49152, "UDP port of its stream", "", 1, 65535),
    NodeParameter("ft_page_port", 80, "TCP port of its web page", "", 1, 65535),
    NodeParameter("ft_timeout", 0.01, "time without a record that is a fault", "s", 0.001, 1.0),
    NodeParameter("ft_all", False, "whether ft has every record, or one a cycle"),
)
LIMITS = (
    NodeParameter(
        "torque_limit", DERIVED, "largest torque that is commanded; -1: derived", "N m", DERIVED, 1000.0
    ),
    NodeParameter("slew_limit", SLEW, "largest change of torque in a second", "N m/s", 1.0, 1e6),
    NodeParameter(
        "soft_start", 500.0, "growth of the limit after activation, fault, pause", "N m/s", 1.0, 1e5
    ),
    NodeParameter("deflection_limit", DERIVED, "of the spring; 0: none; -1: derived", "rad", DERIVED, 100.0),
    NodeParameter(
        "velocity_limit", DERIVED, "of the gear output; 0: none; -1: derived", "rad/s", DERIVED, 1000.0
    ),
    NodeParameter(
        "position_limit", 0.0, "either way from zero (position_zero), 3 turns at most; 0: none",
        "rad", 0.0, 3.0 * math.tau,
    ),
    NodeParameter(
        "ft_limit", DERIVED, "of the torque that ft measures; 0: none; -1: derived", "N m", DERIVED, 1000.0
    ),
    NodeParameter("power_limit", POWER, "of the motor torque times velocity; 0: none", "W", 0.0, 1e5),
    NodeParameter(
        "effort_limit", DERIVED, "by which measured may miss commanded; 0: none; -1: derived", "N m",
        DERIVED, 1000.0,
    ),
    NodeParameter("effort_time", 0.1, "for which it may", "s", 0.0, 10.0),
    NodeParameter("temperature_limit", 70.0, "of the motor; 0: none", "°C", 0.0, 100.0),
    NodeParameter(
        "current_limit", DERIVED, "of the motor, measured; 0: none; -1: derived", "A", DERIVED, 100.0
    ),
    NodeParameter("voltage_limit", DERIVED, "lowest supply; 0: none; -1: derived", "V", DERIVED, 100.0),
    NodeParameter("command_timeout", 0.05, "time without a command that ends the torque", "s", 0.001, 10.0),
    NodeParameter("ramp", 0.02, "from there to zero torque", "s", 0.0, 10.0),
    NodeParameter("lost_cycles", 3, "cycles in a row without an answer that are a fault", "", 1, 100),
    NodeParameter("lost_time", 0.01, "which they last at least, at any rate", "s", 0.0, 0.1),
    AXIS,
)  # fmt: skip


def devices_of(
    joints: Sequence[Values], known: Mapping[str, Callable[[Values], Device]]
) -> tuple[list[Device], list[Line]]:
    """Return the device of each joint, not open, and the lines that some of them share.

    Raises ParameterError for devices that do not exist, cannot be made or are in each other's way.
    """
    lines = _lines(joints)
    devices = []
    for values in joints:
        line = lines.get(values["port"]) if values["device"] == DYNAMIXEL else None
        devices.append(dynamixel_netft(values, line) if line is not None else device_of(values, known))
    return devices, list(lines.values())


def _lines(joints: Sequence[Values]) -> dict[str, Line]:
    """Return the line of each port that several joints share. Raises ParameterError for two that collide."""
    on_buses = [values for values in joints if values["device"] in (DYNAMIXEL, CAN)]
    for values in on_buses:
        for other in on_buses[: on_buses.index(values)]:
            _check_apart(values, other)
    motors = [values for values in on_buses if values["device"] == DYNAMIXEL]
    ports = [values["port"] for values in motors]
    return {
        values["port"]: Line(values["port"], values["baud"], latency_of(values), fast=values["fast_sync"])
        for values in motors
        if ports.count(values["port"]) > 1
    }


def _check_apart(values: Values, other: Values) -> None:
    """Raise ParameterError where two joints have one motor or sensor, or want their port differently."""
    joint, other_joint = values["joint"], other["joint"]
    places = [(each["ft_host"], each["ft_port"]) for each in (values, other)]
    if values["ft_host"] and places[0] == places[1]:
        raise ParameterError(
            f"parameter {joint}.ft_host = {values['ft_host']}, expected another than {other_joint}'s: a"
            " sensor has one client (empty: there is none)"
        )
    if values["port"] != other["port"] or values["device"] != other["device"]:
        return
    for name in ("id", "encoder_id"):
        if values[name] >= 0 and values[name] in (other["id"], other["encoder_id"]):
            text = f"parameter {joint}.{name} = {values[name]}, expected another than {other_joint}'s"
            raise ParameterError(text)
    for name in ("baud", "latency", "fast_sync"):
        if values[name] != other[name]:
            text = f"{other[name]} as {other_joint}'s on {values['port']}"
            raise ParameterError(f"parameter {joint}.{name} = {values[name]}, expected {text}")
