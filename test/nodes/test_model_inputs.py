"""The model node's inputs: joint states that stand still do not outvote a live F/T sensor."""

import math

import pytest

from msg_adapters.ros import JointState, WrenchStamped, joint_state_message, wrench_message
from rsea_ros.model.observer import Observer, noise_of
from rsea_ros.model.rig_file import load_rig
from rsea_ros.nodes._model_inputs import ModelInputs
from rsea_ros.nodes._qos import COMMAND

RIG = load_rig("paper_high_impedance")
EPOCH, PERIOD = 1_700_000_000_000_000_000, 1e9 / 280.0


@pytest.fixture
def heard(listener):
    """Inputs on topics of this process, and publishers of them."""
    node = listener.node
    inputs = ModelInputs(
        node, Observer(RIG), 0.02, "torque.z", True, joint="joint", ft_noise=noise_of(RIG).ft
    )
    state, ft = (
        node.create_publisher(kind, topic, COMMAND)
        for kind, topic in ((JointState, "joint_states"), (WrenchStamped, "ft"))
    )
    listener.until(lambda: state.get_subscription_count() and ft.get_subscription_count())
    yield inputs, state, ft


def test_frozen_joint_states_are_left_out_and_reported(heard, listener):
    inputs, state, ft = heard
    estimates = []
    for k in range(200):
        torque = 5.0 * math.sin(2.0 * math.pi * 2.0 * min(k, 90) / 280.0) + 0.02 * (k - 90) * (k > 90)
        torque += 0.01 * (-1) ** k
        position = (torque if k < 90 else 4.0) / RIG["spring.stiffness"]
        stamp = round(EPOCH + k * PERIOD)
        state.publish(joint_state_message(stamp, position, 0.0, 0.0))
        ft.publish(wrench_message(stamp, torque))
        if k % 20 == 19:
            count = len(estimates)

            def arrived(count=count):
                estimates.extend(inputs.take())
                return len(estimates) >= count + 20

            listener.until(arrived)
        if k == 85:
            assert inputs.frozen == []
    assert inputs.frozen == ["joint_states"]
    assert estimates[-1][1].distal == pytest.approx(torque, abs=0.5)
