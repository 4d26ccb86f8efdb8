"""The devices of several joints: motors on one port share a line, and nothing else is shared."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from rsea_ros.errors import ParameterError
from rsea_ros.hardware.device import Device
from rsea_ros.hardware.dynamixel.line import Line
from rsea_ros.nodes._devices import DYNAMIXEL, Values, device_of, dynamixel_netft, latency_of


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
    motors = [values for values in joints if values["device"] == DYNAMIXEL]
    for values in motors:
        for other in motors[: motors.index(values)]:
            _check_apart(values, other)
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
    if values["port"] != other["port"]:
        return
    for name in ("id", "encoder_id"):
        if values[name] >= 0 and values[name] in (other["id"], other["encoder_id"]):
            text = f"parameter {joint}.{name} = {values[name]}, expected another than {other_joint}'s"
            raise ParameterError(text)
    for name in ("baud", "latency", "fast_sync"):
        if values[name] != other[name]:
            text = f"{other[name]} as {other_joint}'s on {values['port']}"
            raise ParameterError(f"parameter {joint}.{name} = {values[name]}, expected {text}")
