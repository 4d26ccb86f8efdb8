"""What a node is made of."""

from msg_adapters.ros import Bool, DiagnosticArray, JointState, torque_command_message
from msg_adapters.topic_map import JOINT_STATE, WRENCH, sign_and_index
from rsea_ros.nodes._cycle import SECOND, Cycle, on_grid
from rsea_ros.nodes._health import OK, Health, NodeHealth
from rsea_ros.nodes._parameters import AXIS, JOINT, NodeParameter
from rsea_ros.nodes._qos import COMMAND, LATCHED, MEASUREMENT, await_arrival, publishers_of
from rsea_ros.nodes._run import Component, Program
from rsea_ros.nodes._tap import Mailbox, MessageFields, raw_writer

__all__ = [
    "AXIS", "COMMAND", "JOINT", "JOINT_STATE", "LATCHED", "MEASUREMENT", "OK", "SECOND", "WRENCH", "Bool",
    "Component", "Cycle", "DiagnosticArray", "Health", "JointState", "Mailbox", "MessageFields",
    "NodeHealth", "NodeParameter", "Program", "await_arrival", "on_grid", "publishers_of",
    "raw_writer", "sign_and_index", "torque_command_message",
]  # fmt: skip
