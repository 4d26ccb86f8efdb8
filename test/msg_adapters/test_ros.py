"""Messages for the nodes: types by name, and bytes of this package that Fast CDR understands."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from foreign import JOINT_STATE
from rclpy.serialization import deserialize_message

from msg_adapters import cdr, ros
from rsea_ros.errors import ParameterError

STAMP = 1_763_000_000_123_456_789


def test_types_are_found_by_name():
    assert ros.message_type(JOINT_STATE) is ros.JointState
    with pytest.raises(ParameterError, match="message type 'own_msgs/msg/Thing' is not installed"):
        ros.message_type("own_msgs/msg/Thing")


def test_our_bytes_are_understood_by_fast_cdr():
    (raw,) = cdr.joint_states(np.array([STAMP]), "knee", effort=np.array([-3.5]))
    state = deserialize_message(raw, ros.JointState)
    assert (ros.stamp_of(state.header.stamp), state.name, *state.effort) == (STAMP, ["knee"], -3.5)
    (raw,) = cdr.wrenches(np.array([STAMP]), np.arange(6.0)[None, :])
    wrench = deserialize_message(raw, ros.WrenchStamped)
    assert (ros.stamp_of(wrench.header.stamp), wrench.wrench.torque.x) == (STAMP, 3.0)


def test_bags_need_no_ros():
    program = (
        "import sys, msg_adapters, msg_adapters.records, msg_adapters.tables\n"
        "print([name for name in sys.modules if name.endswith('_msgs') or name == 'rclpy'])"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"
