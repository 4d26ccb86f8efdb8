"""Nodes of this process: parameters change while they run, and what a recording and a replay hold and say."""

import struct
import time
from types import SimpleNamespace

import numpy as np
import pytest
import yaml
from rcl_interfaces.msg import ParameterEvent, ParameterValue
from rcl_interfaces.srv import ListParameters
from rclpy.lifecycle import LifecycleNode
from rclpy.qos import qos_profile_sensor_data
from rclpy.serialization import deserialize_message, serialize_message

from msg_adapters import BagWriter, iterate
from msg_adapters.ros import Bool, Clock, JointState, parameters_message, torque_command_message
from rsea_ros.nodes import driver
from rsea_ros.nodes._joints import joint_table
from rsea_ros.nodes._parameters import declare
from rsea_ros.nodes._qos import COMMAND, LATCHED
from rsea_ros.nodes.joint import compose
from test.nodes.test_driver import Spy

SERVES = True
EVENT = "rcl_interfaces/msg/ParameterEvent"


@pytest.fixture
def driven(listener, monkeypatch):
    """A function that makes a driver of spies with its parameters declared: node, program, spies."""
    made = []

    def make(name, **given):
        spies = []

        def spy(values):
            spies.append(Spy())
            return spies[-1]

        monkeypatch.setattr(driver, "DEVICES", {"simulated": spy})
        node = LifecycleNode(name, namespace=name, automatically_declare_parameters_from_overrides=True)
        for key, value in given.items():
            node.declare_parameter(key, value)
        values = declare(node, driver.TABLE, lambda given: joint_table(driver.TABLE, given))
        made.append((driver.DriverNode(node, values), node))
        listener.serve(node)
        return node, made[-1][0], spies

    yield make
    for program, node in made:
        program.close()
        listener.drop(node)


def test_a_limit_goes_down_under_torque_and_up_without(driven, put, listener):
    node, program, (spy,) = driven("changed", rate=200.0, autostart=True, resume=True, command_timeout=5.0)
    commands = listener.node.create_publisher(JointState, "/changed/torque_command", COMMAND)

    def until_written(torque):
        command = lambda: commands.publish(torque_command_message(0, 5.0))  # noqa: E731
        listener.until(lambda: spy.written and spy.written[-1] == torque, command)

    until_written(5.0)
    assert put(node, torque_limit=2.0) == ""
    until_written(2.0)
    assert "raised while active, expected deactivate" in put(node, torque_limit=3.0)
    assert "out of range" in put(node, torque_limit=float("nan"))
    assert "read-only" in put(node, rate=300.0)
    assert node.get_parameter("torque_limit").value == 2.0
    assert program.joints[0].report().values["torque_limit"] == "2"
    node.trigger_deactivate()
    assert put(node, torque_limit=3.0) == ""
    assert "at most 250, what configure has checked" in put(node, power_limit=251.0)
    until_written(0.0)
    node.trigger_activate()
    until_written(3.0)


def test_before_configure_a_limit_is_checked_and_counts_from_there_on(driven, put):
    node, program, spies = driven("early")
    assert "velocity_limit = 900 rad/s, expected at most" in put(node, velocity_limit=900.0)
    assert put(node, torque_limit=9.0, velocity_limit=1.0) == ""
    node.trigger_configure()
    limits = program.joints[0].guarded.guard.limits
    assert (limits.torque, limits.velocity) == (9.0, 1.0)
    assert len(spies) == 2, "the device checks limits when it is opened, so it is made with the new ones"


def test_each_joint_has_limits_of_its_own(driven, put):
    node, program, _ = driven("arm", joints=["hip", "knee"])
    node.trigger_configure()
    assert put(node, hip__torque_limit=7.0) == ""
    hip, knee = (joint.guarded.guard.limits.torque for joint in program.joints)
    assert hip == 7.0 < knee
    for values in ({"torque_limit": 6.0}, {"hip__torque_limit": 6.0, "knee__torque_limit": 6.0}):
        assert "expected limits of one joint at once, of hip, knee" in put(node, **values)


def test_a_change_while_a_node_is_asked_stands_after_its_answer(listener, tmp_path):
    """The answer was stamped when it came: whoever read the last value of a bag read the older one."""
    record = compose("record", listener.executor, {"out": str(tmp_path / "bag")}, namespace="asked")
    named = SimpleNamespace(result=SimpleNamespace(names=["tolerance"]))
    values = [ParameterValue(type=3, double_value=value) for value in (0.3, 0.2)]

    class Service:
        async def call_async(self, request):
            if isinstance(request, ListParameters.Request):
                return named
            event = parameters_message(time.time_ns(), "/asked/model", {"tolerance": values[1]})
            record.program._bag.write("/parameter_events", EVENT, time.time_ns(), serialize_message(event))
            return SimpleNamespace(values=values[:1])

    try:
        with pytest.raises(StopIteration):
            record.program._keep_parameters("/asked/model", Service(), Service()).send(None)
    finally:
        record.close()
    rows = [row[-1] for row in iterate(tmp_path / "bag") if row[1] == EVENT]
    told = [deserialize_message(raw, ParameterEvent) for raw in rows]
    own = [event.new_parameters[0].value.double_value for event in told if event.node == "/asked/model"]
    assert own == [0.3, 0.2]


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_a_bag_has_the_flag_parameters_offered_qos_and_the_distribution(listener, tmp_path, put, storage):
    """None of them was in it: a flag that was up before and stayed so was no message at all."""
    flag = listener.node.create_publisher(Bool, f"/{storage}/pure_torque", LATCHED)
    desired = listener.node.create_publisher(JointState, f"/{storage}/desired_torque", COMMAND)
    flag.publish(Bool(data=True))
    executor = listener.executor
    model = compose("model", executor, {"quiet": 7.0}, namespace=storage)
    bag = tmp_path / "bag"
    record = compose("record", executor, {"out": str(bag), "storage": storage}, namespace=storage)
    try:
        listener.until(desired.get_subscription_count)
        desired.publish(torque_command_message(0, 3.0))
        taps = record.program._taps
        listener.until(lambda: taps["pure_torque"].count > 1 and taps["desired_torque"].count)
        listener.until(lambda: model.node.get_fully_qualified_name() in record.program._asked)
        written, write = [], record.program._bag.write
        record.program._bag.write = lambda *row: written.append(row[-1]) or write(*row)
        assert put(model.node, tolerance=0.2) == ""
        changed = struct.pack("<d", 0.2)
        listener.until(lambda: any(changed in raw for raw in written) and not list(record.node.clients))
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
        for second in (100, 102):
            bag.write("/still/flag", "std_msgs/msg/Bool", second * 10**9, bytes([0, 1, 0, 0, 1]))
    heard = []
    told = "/clock", lambda m: heard.append((time.monotonic(), m.clock.sec + 1e-9 * m.clock.nanosec))
    listener.subscriptions.append(listener.node.create_subscription(Clock, *told, qos_profile_sensor_data))
    given = {"bag": str(tmp_path / "bag"), "subscribers": 0, "rate": 2.0}
    replay = compose("replay", listener.executor, given)
    try:
        listener.until(replay.program.is_finished)
    finally:
        replay.close()
    at, clock = np.array(heard).T
    assert len(at) > 25 and clock[0] < 100.4 and clock[-1] > 100.7
    lag = at - clock / 2.0
    assert np.ptp(lag) < 0.2 and np.all(np.diff(clock) >= 0.0)
