"""A recording: what it holds by default, and what its metadata say."""

from __future__ import annotations

import pytest
import yaml
from rcl_interfaces.msg import ParameterEvent
from rclpy.serialization import deserialize_message

from msg_adapters import iterate
from msg_adapters.ros import Bool, JointState, torque_command_message
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
