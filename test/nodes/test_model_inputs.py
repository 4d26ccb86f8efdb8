"""The model node's inputs: joint states that stand still do not outvote a live F/T sensor."""

import math

import numpy as np
import pytest

from bench.observer.truth import true_run
from msg_adapters.ros import (
    JointState,
    WrenchStamped,
    joint_state_message,
    torque_command_message,
    wrench_message,
)
from rsea_ros.model.observer import Observer, noise_of
from rsea_ros.model.rig_file import load_rig
from rsea_ros.nodes._joint_inputs import Frozen, InputSettings, ModelInputs, StoppedSensors
from rsea_ros.nodes._qos import COMMAND

RIG = load_rig("paper_high_impedance")
READ = InputSettings(0.02, "torque.z", True)
EPOCH, PERIOD = 1_700_000_000_000_000_000, 1e9 / 280.0


def feed(listener, inputs, publishers, samples):
    """Publish samples of command, (position, effort) and torque; return the estimates."""
    estimates = []
    for start in range(0, len(samples), 20):
        some, before = samples[start : start + 20], len(estimates)
        for k, (command, state, torque) in enumerate(some, start):
            stamp = round(EPOCH + k * PERIOD)
            publishers["torque_command"].publish(torque_command_message(stamp, command))
            publishers["joint_states"].publish(joint_state_message(stamp, state[0], 0.0, state[1]))
            publishers["ft"].publish(wrench_message(stamp, (0.0,) * 5 + (torque,)))

        def has_arrived():
            estimates.extend(estimate for _, estimate in inputs.take())
            return len(estimates) >= before + len(some) or inputs.stopped.ft_frozen  # noqa: B023  called at once

        listener.until(has_arrived)
    return estimates


@pytest.fixture
def inputs_of(listener):
    """A function that makes inputs and publishers of their topics."""
    made = []

    def make(**more):
        node = listener.node
        inputs = ModelInputs(node, Observer(RIG), StoppedSensors(noise_of(RIG), **more), READ)
        kinds = {"torque_command": JointState, "joint_states": JointState, "ft": WrenchStamped}
        made.extend(node.create_publisher(kind, topic, COMMAND) for topic, kind in kinds.items())
        publishers = dict(zip(kinds, made[-3:], strict=True))
        listener.until(lambda: all(each.get_subscription_count() for each in publishers.values()))
        return inputs, publishers

    yield make
    for publisher in made:
        listener.node.destroy_publisher(publisher)


def test_a_value_with_noise_that_stands_still_has_stopped_and_may_go_on():
    ft = Frozen()
    assert not any(ft.take(round(k * PERIOD), (0.01 * (k % 3),)) for k in range(100))
    assert [ft.take(round((100 + k) * PERIOD), (1.0,)) for k in range(30)][-1]
    assert not ft.take(round(130 * PERIOD), (1.1,))


def test_a_joint_at_rest_is_no_fault_until_its_torque_moves():
    joint = Frozen(least=0.3)
    for k in range(100):
        joint.beside(0.02 * (-1) ** k)
        assert not joint.take(round(k * PERIOD), (0.1, 0.0))
    for k in range(100, 130):
        joint.beside(0.05 * (k - 100))
        stopped = joint.take(round(k * PERIOD), (0.1, 0.0))
    assert stopped


def test_a_few_equal_samples_are_chance():
    ft = Frozen()
    assert not any(ft.take(round(k * PERIOD), (float(k // 8),)) for k in range(200))


@pytest.mark.parametrize("noise", [0.0, 1.0])
def test_the_estimate_follows_ft_as_soon_as_joint_states_stand_still(listener, inputs_of, noise):
    """It was 18 N m off, and under noise of its own for as long as they stood, then ft was named for it."""
    inputs, publishers = inputs_of(stiffness=RIG["spring.stiffness"])
    count, stop = 500, 180
    run = true_run(RIG, 10.0 * np.sin(10.0 * math.pi * np.arange(count) / 280.0), 280.0, seed=1)
    command, position, effort, ft = (
        run.record[n].y.copy() for n in ("command", "position", "motor_torque", "ft")
    )
    dice = np.random.default_rng(2).standard_normal((2, count - stop))
    position[stop:] = position[stop] + noise * noise_of(RIG).position * dice[0]
    effort[stop:] = effort[stop] + noise * noise_of(RIG).motor_torque * dice[1]
    states = zip(position.tolist(), effort.tolist(), strict=True)
    samples = list(zip([*command[1:], 0.0], states, ft.tolist(), strict=True))
    estimates = feed(listener, inputs, publishers, samples)
    off = np.abs(np.array([each.distal for each in estimates]) - run.distal)
    assert off[stop:].max() < 1.5 and off[stop + 28 :].max() < 0.15
    assert inputs.stopped.frozen == ["joint_states"]


def test_a_torque_that_is_no_number_is_none(listener, inputs_of):
    """The flag of pure torque stayed up over 1.8 s of NaN: the sensor had spoken."""
    inputs, publishers = inputs_of()
    feed(listener, inputs, publishers, [(0.0, (0.0, 0.0), 0.01 * k) for k in range(20)])
    assert not inputs.ft_silent
    for k, torque in enumerate([math.nan] * 15 + [1e300] * 15, 20):
        stamp = round(EPOCH + k * PERIOD)
        publishers["torque_command"].publish(torque_command_message(stamp, 0.0))
        publishers["joint_states"].publish(joint_state_message(stamp, 0.0, 0.0, 0.0))
        publishers["ft"].publish(wrench_message(stamp, (0.0,) * 5 + (torque,)))
    listener.until(lambda: [*inputs.take()] and inputs.refused >= 30)
    assert inputs.ft_silent


def test_a_topic_that_falls_silent_is_waited_for_only_so_long(listener, inputs_of, monkeypatch):
    monkeypatch.setattr("rsea_ros.nodes._joint_inputs.PATIENCE", 0.2)
    inputs, publishers = inputs_of()
    feed(listener, inputs, publishers, [(0.0, (0.0, 0.0), 0.01 * k) for k in range(20)])
    for k in range(20, 60):  # the others go on without ft
        stamp = round(EPOCH + k * PERIOD)
        publishers["torque_command"].publish(torque_command_message(stamp, 0.0))
        publishers["joint_states"].publish(joint_state_message(stamp, 1e-5 * k, 0.0, 0.0))
    listener.until(lambda: [*inputs.take()] and inputs.ft_silent)


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
