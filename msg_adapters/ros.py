"""Message types of ROS for the nodes, made from plain numbers. Needs ROS.

Stamps are integers, ns since the epoch; values are SI.
"""

import importlib
from collections.abc import Mapping, Sequence
from typing import Any

import rcl_interfaces.msg as rcl
import yaml
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import WrenchStamped
from lifecycle_msgs.srv import ChangeState, GetAvailableTransitions, GetState
from rcl_interfaces.msg import Parameter, ParameterDescriptor, ParameterEvent, SetParametersResult
from rcl_interfaces.srv import GetParameters, ListParameters
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool
from std_srvs.srv import Trigger

from msg_adapters.cdr import SECOND
from rsea_ros.errors import ParameterError

__all__ = [
    "Bool", "ChangeState", "Clock", "DiagnosticArray", "DiagnosticStatus", "GetAvailableTransitions",
    "GetParameters", "GetState", "JointState", "ListParameters", "SetParametersResult", "Time", "Trigger",
    "WrenchStamped",
]  # fmt: skip

OK, WARN, ERROR, STALE = (b"\x00", b"\x01", b"\x02", b"\x03")


def time_of(stamp_ns: int) -> Time:
    """Return a stamp as a message."""
    return Time(sec=stamp_ns // SECOND, nanosec=stamp_ns % SECOND)


def stamp_of(time: Time) -> int:
    """Return a stamp message in ns."""
    return int(time.sec) * SECOND + int(time.nanosec)


def torque_command_message(stamp_ns: int, effort: float, joint: str = "joint") -> JointState:
    """Return a torque (N m) that takes effect at the stamp."""
    return efforts_message(stamp_ns, {joint: effort})


def efforts_message(stamp_ns: int, efforts: Mapping[str, float]) -> JointState:
    """Return torques (N m) by name, as `torque_estimate` carries them."""
    return state_message(stamp_ns, [*efforts], effort=[float(effort) for effort in efforts.values()])


def state_message(stamp_ns: int, names: Sequence[str], frame: str = "", **values: list[float]) -> JointState:
    """Return states of joints by name: position rad, velocity rad/s, effort N m, those that are given."""
    message = JointState(name=list(names), **values)
    message.header.stamp = time_of(stamp_ns)
    message.header.frame_id = frame
    return message


def joint_state_message(
    stamp_ns: int, position: float, velocity: float, effort: float, joint: str = "joint", frame: str = ""
) -> JointState:
    """Return a state: rad, rad/s, N m."""
    values = {"position": [float(position)], "velocity": [float(velocity)], "effort": [float(effort)]}
    return state_message(stamp_ns, [joint], frame, **values)


def wrench_message(stamp_ns: int, values: Sequence[float], frame: str = "ft_sensor") -> WrenchStamped:
    """Return a wrench of force N and torque N m: all six values in the order of AXES."""
    message = WrenchStamped()
    message.header.stamp = time_of(stamp_ns)
    message.header.frame_id = frame
    force, torque = message.wrench.force, message.wrench.torque
    force.x, force.y, force.z, torque.x, torque.y, torque.z = map(float, values)
    return message


def diagnostics_message(
    stamp_ns: int, name: str, level: bytes, summary: str, values: Mapping[str, object], hardware: str = ""
) -> DiagnosticArray:
    """Return the health of one node; level is OK, WARN, ERROR or STALE. hardware: its subject."""
    return statuses_message(stamp_ns, [(name, level, summary, values)], hardware)


def statuses_message(
    stamp_ns: int, rows: Sequence[tuple[str, bytes, str, Mapping[str, object]]], hardware: str = ""
) -> DiagnosticArray:
    """Return several statuses, each of name, level, summary and values, about the same hardware."""
    statuses = []
    for name, level, summary, values in rows:
        pairs = [KeyValue(key=key, value=str(value)) for key, value in values.items()]
        statuses.append(
            DiagnosticStatus(level=level, name=name, message=summary, values=pairs, hardware_id=hardware)
        )
    message = DiagnosticArray(status=statuses)
    message.header.stamp = time_of(stamp_ns)
    return message


def parameter_descriptor(
    description: str, constraints: str = "", bounds: tuple[float, float] | tuple[int, int] | None = None,
    *, fixed: bool = True,
) -> ParameterDescriptor:  # fmt: skip
    """Return the descriptor of a parameter; bounds are inclusive. fixed: once the node runs."""
    descriptor = ParameterDescriptor(
        description=description, additional_constraints=constraints, read_only=fixed
    )
    if bounds is not None and isinstance(bounds[0], int):
        descriptor.integer_range = [rcl.IntegerRange(from_value=bounds[0], to_value=int(bounds[1]))]
    elif bounds is not None:
        descriptor.floating_point_range = [rcl.FloatingPointRange(from_value=bounds[0], to_value=bounds[1])]
    return descriptor


def parameters_message(stamp_ns: int, node: str, values: Mapping[str, Any]) -> ParameterEvent:
    """Return the parameters of a node, values as GetParameters answers, as on /parameter_events."""
    parameters = [Parameter(name=name, value=value) for name, value in values.items()]
    return ParameterEvent(stamp=time_of(stamp_ns), node=node, new_parameters=parameters)


def message_type(name: str) -> Any:
    """Return the class of a type such as 'sensor_msgs/msg/JointState'.

    Raises ParameterError for one that is not installed.
    """
    package, _, kind = name.partition("/msg/")
    try:
        return getattr(importlib.import_module(f"{package}.msg"), kind)
    except (ImportError, AttributeError):
        raise ParameterError(
            f"message type {name!r} is not installed, expected a package {package!r}"
        ) from None


def message_text(message: Any) -> str:
    """Return any message as YAML."""
    return yaml.safe_dump(_plain(message), sort_keys=False, allow_unicode=True)


def _plain(value: Any) -> Any:
    if hasattr(value, "get_fields_and_field_types"):
        return {name: _plain(getattr(value, name)) for name in value.get_fields_and_field_types()}
    if isinstance(value, bytes):
        return value.hex()
    if isinstance(value, str | bool | int | float):
        return value
    return [_plain(item) for item in value]
