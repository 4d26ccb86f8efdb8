"""The parts of the health node in this process: inputs, memory, messages, and the file with the noise."""

import math

import numpy as np
import pytest

from msg_adapters import TopicMap, read_record
from msg_adapters.ros import ERROR, OK, WARN, JointState, WrenchStamped, joint_state_message, wrench_message
from rsea_ros.errors import ParameterError
from rsea_ros.health.health_finding import NAMES, HealthFinding
from rsea_ros.model.rig_file import load_rig
from rsea_ros.nodes._joint_inputs import HealthInputs, noise_from
from rsea_ros.nodes._qos import COMMAND
from rsea_ros.nodes.health import FindingsPublisher, Keeper, Ring

EPOCH, PERIOD = 1_700_000_000_000_000_000, round(1e9 / 280.0)
TOPICS = ("joint_states", "torque_command", "ft")
STATE = "sensor_msgs/msg/JointState"


@pytest.fixture
def heard(listener):
    """Inputs on topics of this process with a ring, and publishers of them."""
    ring = Ring(60.0, 1.0)
    inputs = HealthInputs(listener.node, "torque.z", "joint", ring.add)
    state, command, ft = (
        listener.node.create_publisher(kind, topic, COMMAND)
        for topic, kind in zip(TOPICS, (JointState, JointState, WrenchStamped), strict=True)
    )
    listener.until(lambda: all(p.get_subscription_count() for p in (state, command, ft)))
    return inputs, ring, state, command, ft


def take_all(inputs, listener, count):
    """Everything that is complete, once some messages have come."""
    rows = []

    def has_come():
        rows.append(inputs.take())
        return sum(inputs.counts.values()) + inputs.refused >= count

    listener.until(has_come)
    return tuple(np.concatenate(parts) for parts in zip(*rows, strict=True))


def test_events_are_sorted_strangers_are_refused_and_bags_can_be_read(heard, listener, tmp_path):
    inputs, ring, state, command, ft = heard
    for k in range(100):
        stamp = EPOCH + k * PERIOD
        ft.publish(wrench_message(stamp, (0.0,) * 5 + (0.1 * k,)))
        state.publish(joint_state_message(stamp, 1e-3 * k if k != 50 else math.nan, 0.0, 0.0))
        command.publish(joint_state_message(stamp, 0.0, 0.0, 1.0))
    state.publish(joint_state_message(EPOCH, 0.0, 0.0, 0.0, joint="elbow"))
    command.publish(joint_state_message(EPOCH, 0.0, 0.0, math.inf))
    t, kind, values = take_all(inputs, listener, 302)
    assert np.all(np.diff(t) >= 0.0) and len(t) > 3 * 60 and set(kind) == {0, 1, 2}
    assert np.isnan(values[kind == 0, 0]).sum() == 1 and inputs.refused == 2
    keeper = Keeper(ring, tmp_path / "kept", 1, 0.0)
    middle = sorted(m.at for m in ring.messages())[150]
    keeper.ask("RSEA_STIFFNESS", middle)
    listener.until(lambda: keeper.poll() is not None)
    assert keeper.last is not None
    assert len(read_record(keeper.last / "after", topics=TopicMap(namespace="/"), strict=False)["ft"]) > 20
    keeper.ask("RSEA_STIFFNESS", middle)
    keeper.poll()
    assert "holds 1, expected less than 1 (bags)" in keeper.trouble
    keeper.close()
    assert len(list((tmp_path / "kept").iterdir())) == 1


def test_stamps_of_another_time_restart_the_watch(heard, listener):
    inputs, _, state, _, _ = heard
    for first in (EPOCH, EPOCH - 3600 * 10**9):
        for k in range(60):
            state.publish(joint_state_message(first + k * PERIOD, 0.0, 0.0, 0.0))
        listener.until(lambda first=first: inputs.counts["joint_states"] >= (60 if first == EPOCH else 120)
                       or len(inputs.take()[0]) < 0)  # fmt: skip
    assert len(inputs._waiting) <= 60


def test_commands_to_a_joint_that_publishes_nothing_do_not_pile_up(heard, listener, monkeypatch):
    """They wait for measurements of their time: 280 a second for as long as these stopped."""
    monkeypatch.setattr("rsea_ros.nodes._joint_inputs.MOST", 50)
    inputs, _, _, command, _ = heard
    for k in range(120):
        command.publish(joint_state_message(EPOCH + k * PERIOD, 0.0, 0.0, 1.0))
    listener.until(lambda: len(inputs.take()[0]) == 0 and inputs.counts["torque_command"] >= 120)
    assert len(inputs._waiting) == 50


def test_memory_is_bounded_in_time_and_size():
    ring = Ring(1.0, 0.001)
    for k in range(1000):
        ring.add("/a", STATE, k * 10_000_000, bytes(10))
    assert len(ring.messages()) == 100 and ring.size == 1000
    ring.add("/a", STATE, 9_990_000_001, bytes(5000))
    assert ring.size <= 1000


def test_every_code_has_a_status_of_its_own(listener):
    node_statuses = [
        HealthFinding("RSEA_BACKLASH", "backlash.gap", 2.0, 0.99, "rad", 4e-3, (3.9e-3, 4.1e-3)),
        HealthFinding("RSEA_SENSOR_FROZEN", "ft", 1.0),
    ]
    publisher = FindingsPublisher(
        listener.node, "knee", lambda: node_statuses, lambda t: EPOCH + round(t * 1e9)
    )
    messages = []
    publisher._publisher.publish = messages.append
    publisher.publish()
    statuses = {s.name.split(": ")[1]: s for s in messages[0].status}
    assert list(statuses) == list(NAMES) and {s.hardware_id for s in statuses.values()} == {"knee"}
    gap = {v.key: v.value for v in statuses["RSEA_BACKLASH"].values}
    assert statuses["RSEA_BACKLASH"].level == WARN and gap["size"] == "0.004" and gap["unit"] == "rad"
    assert (gap["low"], gap["high"], gap["confidence"]) == ("0.0039", "0.0041", "0.990")
    assert gap["since"].startswith("2023-11-14T22:13:22")
    assert statuses["RSEA_SENSOR_FROZEN"].level == ERROR and statuses["RSEA_DELAY"].level == OK


@pytest.mark.parametrize(
    ("text", "why"), [(None, "No such file or directory"), ("name: rig\n", "no JSON"), ("[1, 2]", "")]
)
def test_a_file_of_another_kind_is_refused_in_plain_words(tmp_path, text, why):
    """It said `[Errno 2] …` and `Expecting value: line 1 column 1 (char 0)`."""
    file = tmp_path / "file.json"
    if text is not None:
        file.write_text(text)
    with pytest.raises(ParameterError) as caught:
        noise_from(load_rig("paper_high_impedance"), str(file))
    said = f": {why}" if why else ""
    assert str(caught.value).startswith(f"parameter identification = {str(file)!r}{said}, expected an ident")
