"""Which topic is which channel, and the definitions of their types."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache

from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

from rsea_ros.documents.wording import did_you_mean, quote
from rsea_ros.errors import BagError, ParameterError

JOINT_STATE = "sensor_msgs/msg/JointState"
WRENCH = "geometry_msgs/msg/WrenchStamped"
DYNAMIC = "control_msgs/msg/DynamicJointState"
FLOAT, FLOATS = "std_msgs/msg/Float64", "std_msgs/msg/Float64MultiArray"

AXES = tuple(f"{part}.{axis}" for part in ("force", "torque") for axis in "xyz")
ROLES = ("torque_command", "joint_states", "ft", "deflection", "desired_position")

FIELDS: Mapping[str, Mapping[str, str]] = {
    "torque_command": {"command": "effort"},
    "joint_states": {"position": "position", "velocity": "velocity", "motor_torque": "effort"},
    "ft": {"ft": "wrench"},
    "deflection": {"deflection": "position"},
    "desired_position": {"reference": "position", "reference_velocity": "velocity"},
}
"""By role: the channels of the record, and the field of the message that each comes from."""

TYPES: Mapping[str, str] = {role: WRENCH if role == "ft" else JOINT_STATE for role in ROLES}
"""By role: the type that is written."""
READ: Mapping[str, tuple[str, ...]] = {
    **dict.fromkeys(ROLES, (JOINT_STATE, DYNAMIC, FLOAT, FLOATS)),
    "joint_states": (JOINT_STATE, DYNAMIC),
    "ft": (WRENCH,),
}
"""By role: the types that are read. Numbers without names and stamps are what ros2_control's forward
controllers take; their stamps are the log times."""


def sign_and_index(axis: str) -> tuple[float, int]:
    """Return sign and place in AXES of an actuator axis such as `-torque.z`."""
    return (-1.0 if axis.startswith("-") else 1.0), AXES.index(axis.removeprefix("-"))


_ELEMENT = re.compile(r"\[([0-9]{1,4})\]$")
_NAME = re.compile(r"(/[A-Za-z_][A-Za-z0-9_]*)+")
_LONGEST = 247
"""Characters of a topic: ROS 2 puts eight more in front, and DDS takes 255."""


def check_topic(topic: str) -> None:
    """Refuse a name that no node can have: rosbag2 could not play it. Raises BagError."""
    if not _NAME.fullmatch(topic) or len(topic) > _LONGEST:
        expected = f"letters, digits and _ between slashes, none beginning with a digit, up to {_LONGEST}"
        raise BagError(f"topic {quote(topic)}: is not a name of ROS, expected {expected} characters")


@dataclass(frozen=True)
class TopicMap:
    """Names of the topics of one bench; the defaults are those of README.md.

    A name that starts with a slash is absolute, any other lies in the namespace.
    desired_position is a JointState whose position is the reference of the controller that ran during
    the record, and whose velocity is the target velocity of a MIT frame. It is named like its sibling
    `desired_torque`, after the requested quantity: `reference` names neither quantity nor unit, and in ROS
    often means a reference frame.

    deflection is a JointState whose position is the angle of the spring by its own encoder.

    A number in brackets behind a name, `/effort_controller/commands[2]`, says which of several numbers
    without names counts, from 0.

    joint: which joint, where the messages hold several.
    axis: actuator axis of the wrench, one of AXES, with a leading minus where the sensor faces back.
    required: roles whose topics a bag must hold, since a user named them.
    Raises ParameterError for another axis, and for a name that cannot be printed.
    """

    namespace: str = "/rsea"
    torque_command: str = "torque_command"
    joint_states: str = "joint_states"
    ft: str = "ft"
    deflection: str = "deflection"
    desired_position: str = "desired_position"
    joint: str | None = None
    axis: str = "torque.z"
    required: frozenset[str] = field(default=frozenset(), init=False)

    def __post_init__(self) -> None:
        for name in ("namespace", *ROLES, "joint"):
            value = getattr(self, name) or ""
            if not value.isprintable():
                raise ParameterError(f"{name} {value!r}: cannot be printed, expected a name of ROS")
        if self.axis.removeprefix("-") not in AXES:
            raise ParameterError(
                f"axis {self.axis!r}: expected one of {', '.join(AXES)}, with or without a minus"
                f"{did_you_mean(self.axis.removeprefix('-'), AXES)}"
            )

    def topic(self, role: str) -> str:
        """Return the absolute topic of a role of ROLES."""
        name: str = _ELEMENT.sub("", getattr(self, role))
        return name if name.startswith("/") else f"/{self.namespace.strip('/')}/{name}".replace("//", "/")

    def element(self, role: str) -> int | None:
        """Return which number of a role's messages counts, None where the name does not say."""
        match = _ELEMENT.search(getattr(self, role))
        return int(match[1]) if match else None

    def with_topics(self, assignments: Sequence[str]) -> TopicMap:
        """Return the map with `role=topic` assignments applied, as the command line gives them.

        Those topics are required of a bag. Raises ParameterError for an unknown role.
        """
        names: dict[str, str] = {}
        for assignment in assignments:
            role, equals, topic = assignment.partition("=")
            if role not in ROLES or not equals or not topic:
                near = did_you_mean(role, ROLES) if role not in ROLES else ""
                expected = f"ROLE=TOPIC with ROLE one of {', '.join(ROLES)}{near}"
                raise ParameterError(f"topic {assignment!r}: expected {expected}")
            names[role] = topic
        renamed = replace(self, **names)  # type: ignore[arg-type]  # names of str fields
        object.__setattr__(renamed, "required", self.required | names.keys())
        return renamed


@cache
def definition(msgtype: str) -> tuple[str, str]:
    """Return definition and RIHS01 hash of a message type of ROS 2 Kilted, empty for one that is unknown."""
    store = typestore()
    if msgtype not in store.types:
        return "", ""
    return store.generate_msgdef(msgtype, ros_version=2)[0], store.hash_rihs01(msgtype)


@cache
def typestore() -> Typestore:
    """Return the message types of ROS 2 Kilted."""
    return get_typestore(Stores.ROS2_KILTED)
