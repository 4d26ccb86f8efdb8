"""A recording: what it holds by default, and what its metadata say."""

from __future__ import annotations

import time

import numpy as np
import pytest
import yaml
from rcl_interfaces.msg import ParameterEvent
from rclpy.qos import qos_profile_sensor_data
from rclpy.serialization import deserialize_message

from msg_adapters import BagWriter, iterate
from msg_adapters.ros import Bool, Clock, JointState, torque_command_message
from rsea_ros.nodes._qos import COMMAND, LATCHED
from rsea_ros.nodes.joint import compose
from test.nodes.test_live_parameters import put

__all__ = ["put"]


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_a_bag_has_the_flag_parameters_offered_qos_and_the_distribution(listener, tmp_path, put, storage):
    """None of them was in it: a flag that was up before and stayed so was no message at all."""
    flag = listener.node.create_publisher(Bool, f"/{storage}/pure_torque", LATCHED)
    desired = listener.node.create_publisher(JointState, f"/{storage}/desired_torque", COMMAND)
    flag.publish(Bool(data=True))
    executor = listener._executor
    model = compose("model", executor, {"quiet": 7.0}, namespace=storage)
    bag = tmp_path / "bag"
    record = compose("record", executor, {"out": str(bag), "storage": storage}, namespace=storage)
    try:
        listener.until(desired.get_subscription_count)
        desired.publish(torque_command_message(0, 3.0))
        taps = record.program._taps
        listener.until(lambda: taps["pure_torque"].count > 1 and taps["desired_torque"].count)
        listener.until(lambda: model.node.get_fully_qualified_name() in record.program._asked)
        assert put(model.node, tolerance=0.2) == ""
        listener.until(lambda: taps["/parameter_events"].count and not list(record.node.clients))
    finally:
        model.close()
        record.close()
    rows = list(iterate(bag))
    assert any(raw[-1] == 1 for topic, _, _, raw in rows if topic.endswith("/pure_torque"))
    told = {}
    for topic, _, _, raw in rows:
        if topic == "/parameter_events":
            event = deserialize_message(raw, ParameterEvent)
            for each in (*event.new_parameters, *event.changed_parameters):
                told[event.node, each.name] = each.value
    assert told[f"/{storage}/model", "quiet"].double_value == 7.0
    assert told[f"/{storage}/model", "tolerance"].double_value == 0.2
    known = yaml.safe_load((bag / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    assert known["ros_distro"] == "kilted"
    offered = {
        topic["topic_metadata"]["name"]: topic["topic_metadata"]["offered_qos_profiles"]
        for topic in known["topics_with_message_count"]
    }
    (qos,) = offered[f"/{storage}/desired_torque"]
    assert (qos["reliability"], qos["durability"]) == ("reliable", "volatile")
    assert {each["durability"] for each in offered[f"/{storage}/pure_torque"]} == {"transient_local"}


def test_the_clock_of_a_replay_goes_on_through_a_pause_and_follows_its_pace(listener, tmp_path):
    """It stood still for as long as the bag had no message."""
    with BagWriter(tmp_path / "bag") as bag:
        for second in (100, 101):
            bag.write("/still/flag", "std_msgs/msg/Bool", second * 10**9, bytes([0, 1, 0, 0, 1]))
    heard = []
    told = "/clock", lambda m: heard.append((time.monotonic(), m.clock.sec + 1e-9 * m.clock.nanosec))
    listener.subscriptions.append(listener.node.create_subscription(Clock, *told, qos_profile_sensor_data))
    given = {"bag": str(tmp_path / "bag"), "subscribers": 0, "rate": 2.0}
    replay = compose("replay", listener._executor, given)
    try:
        listener.until(replay.program.is_finished)
    finally:
        replay.close()
    at, clock = np.array(heard).T
    assert len(at) > 25 and clock[0] < 100.4 and clock[-1] > 100.7
    lag = at - clock / 2.0
    assert np.ptp(lag) < 0.2 and np.all(np.diff(clock) >= 0.0)
