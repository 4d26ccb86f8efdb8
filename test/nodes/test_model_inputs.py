"""The model node's inputs: joint states that stand still do not outvote a live F/T sensor."""

import math

import pytest

from msg_adapters.ros import (
    JointState,
    WrenchStamped,
    joint_state_message,
    torque_command_message,
    wrench_message,
)
from rsea_ros.model.observer import Observer
from rsea_ros.model.rig_file import load_rig
from rsea_ros.nodes._model_inputs import InputSettings, ModelInputs, StoppedSensors
from rsea_ros.nodes._qos import COMMAND

RIG = load_rig("paper_high_impedance")
READ = InputSettings(0.02, "torque.z", True)
EPOCH, PERIOD = 1_700_000_000_000_000_000, 1e9 / 280.0


def feed(listener, inputs, publishers, samples):
    """Publish samples of command, (position, effort) and torque, and have them taken."""
    for start in range(0, len(samples), 20):
        some, count = samples[start : start + 20], 0
        for k, (command, state, torque) in enumerate(some, start):
            stamp = round(EPOCH + k * PERIOD)
            publishers["torque_command"].publish(torque_command_message(stamp, command))
            publishers["joint_states"].publish(joint_state_message(stamp, state[0], 0.0, state[1]))
            publishers["ft"].publish(wrench_message(stamp, torque))

        def has_arrived():
            nonlocal count
            count += sum(1 for _ in inputs.take())
            return count >= len(some) or inputs.stopped.frozen  # noqa: B023  called at once

        listener.until(has_arrived)


@pytest.fixture
def inputs_of(listener):
    """A function that makes inputs and publishers of their topics."""
    made = []

    def make(**more):
        node = listener.node
        inputs = ModelInputs(node, Observer(RIG), StoppedSensors(0.03, **more), READ)
        kinds = {"torque_command": JointState, "joint_states": JointState, "ft": WrenchStamped}
        made.extend(node.create_publisher(kind, topic, COMMAND) for topic, kind in kinds.items())
        publishers = dict(zip(kinds, made[-3:], strict=True))
        listener.until(lambda: all(each.get_subscription_count() for each in publishers.values()))
        return inputs, publishers

    yield make
    for publisher in made:
        listener.node.destroy_publisher(publisher)


def test_states_that_stand_still_while_commands_move_are_noticed(listener, inputs_of):
    """Both sensors had stopped, the one under its own noise, and the flag stayed up."""
    inputs, publishers = inputs_of()
    torques = [0.0] * 60 + [8.0 * math.sin(0.1 * k) for k in range(60)]
    samples = [(u, (0.001, 0.1), 1.0 + 0.01 * (-1) ** k) for k, u in enumerate(torques)]
    feed(listener, inputs, publishers, samples[:60])
    assert not inputs.stopped.unmoved
    feed(listener, inputs, publishers, samples)
    assert inputs.stopped.unmoved and inputs.stopped.frozen == []


def test_a_torque_from_an_encoder_may_stand_still_as_long_as_the_joint_does(listener, inputs_of):
    """Of a machine at rest it was said that its sensor had stopped."""
    inputs, publishers = inputs_of(ft_repeats=True, stiffness=RIG["spring.stiffness"])
    still = [(0.0, (0.001, 0.0), 1.53)] * 60
    feed(listener, inputs, publishers, still)
    assert inputs.stopped.frozen == []
    moving = [(0.0, (0.001 + 1e-4 * k, 0.0), 1.53) for k in range(60)]
    feed(listener, inputs, publishers, [*still, *moving])
    assert inputs.stopped.frozen == ["ft"]
