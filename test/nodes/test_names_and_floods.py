"""Names and quality of service by parameter, floods of commands, services that take long."""

import math
import threading
import time

import pytest
from rclpy.parameter import Parameter
from rclpy.qos import ReliabilityPolicy
from std_msgs.msg import Float64MultiArray, MultiArrayDimension, MultiArrayLayout

from msg_adapters.ros import JointState, Trigger, WrenchStamped, stamp_of, torque_command_message
from msg_adapters.topic_map import FLOATS
from rsea_ros.hardware.device import NoReply
from rsea_ros.nodes import driver
from rsea_ros.nodes._bench_topics import MOST, NAMES, BenchTopics
from rsea_ros.nodes._cycle import Anchor
from rsea_ros.nodes._qos import COMMAND, LATCHED, MEASUREMENT
from rsea_ros.nodes.model import Flags
from test.nodes.test_driver import Spy

VALUES = {parameter.name: parameter.default for parameter in driver.TABLE} | {
    "rate": 200.0, "autostart": True, "resume": True, "command_timeout": 5.0, "effort_limit": 0.0,
}  # fmt: skip


@pytest.fixture
def drive(make_driver):
    """A function that makes a driver with these values and those given."""

    def make(name, overrides=(), **values):
        return make_driver(name, VALUES | values, overrides)

    return make


def test_joint_frames_and_quality_of_service_are_parameters(drive, listener):
    best_effort = Parameter("qos_overrides./named/ft.publisher.reliability", value="best_effort")
    drive("named", [best_effort], joint="left_knee", frame="thigh", ft_frame="shank")
    states = listener.hear(JointState, "/named/joint_states", MEASUREMENT)
    wrenches = listener.hear(WrenchStamped, "/named/ft", MEASUREMENT)
    listener.until(lambda: states and wrenches)
    assert (states[0].name, states[0].header.frame_id) == (["left_knee"], "thigh")
    assert wrenches[0].header.frame_id == "shank"
    kinds = {
        name: listener.node.get_publishers_info_by_topic(f"/named/{name}")[0].qos_profile.reliability
        for name in ("ft", "joint_states")
    }
    assert kinds == {"ft": ReliabilityPolicy.BEST_EFFORT, "joint_states": ReliabilityPolicy.RELIABLE}


def test_a_cycle_takes_a_bounded_number_of_commands_and_the_newest_acts(listener, monkeypatch):
    """20 kHz of commands stopped the cycle for as long as they lasted."""
    names = {parameter.name: parameter.default for parameter in NAMES}
    bench, anchor = BenchTopics(listener.node, names, strict=True), Anchor()
    publisher = listener.node.create_publisher(JointState, "torque_command", COMMAND)
    listener.until(publisher.get_subscription_count)
    for k in range(1000):
        publisher.publish(torque_command_message(time.time_ns(), float(k)))
    taken, add = [], bench.commands.add
    monkeypatch.setattr(bench.commands, "add", lambda *command: (taken.append(command[1]), add(*command)))
    counts = []

    def poll():
        before = len(taken)
        bench.poll(anchor)
        counts.append(len(taken) - before)
        return taken and taken[-1] == 999.0

    listener.until(poll)
    assert max(counts) <= MOST
    bench.commands.take(anchor.now())
    assert bench.commands.torque == 999.0
    bench.close()
    listener.node.destroy_publisher(publisher)


def test_numbers_without_names_and_stamps_are_commands_where_the_driver_is_told_so(listener):
    """What clients of ros2_control's forward controllers send: on arrival, by the same rules as any other."""
    names = {parameter.name: parameter.default for parameter in NAMES}
    bench = BenchTopics(listener.node, names | {"command_type": FLOATS, "torque_limit": 68.0}, strict=True)
    anchor = Anchor()
    publisher = listener.node.create_publisher(Float64MultiArray, "torque_command", COMMAND)
    listener.until(publisher.get_subscription_count)
    for count, (numbers, torque, refused) in enumerate((
        ([3.0], 3.0, 0), ([math.nan], 3.0, 1), ([681.0], 3.0, 2), ([1.0, 2.0], 3.0, 3), ([], 3.0, 4),
        ([-5.0], -5.0, 4),
    ), 1):  # fmt: skip
        shape = [MultiArrayDimension(label="joint", size=1, stride=1)] * (count % 2)
        publisher.publish(Float64MultiArray(layout=MultiArrayLayout(dim=shape), data=numbers))
        heard = bench.commands

        def poll(heard=heard):
            bench.poll(anchor)
            heard.take(anchor.now())
            return heard.refused + heard.unstamped

        listener.until(lambda poll=poll, count=count: poll() == count)
        assert (heard.torque, heard.refused, heard.off) == (torque, refused, 0)
    bench.close()
    listener.node.destroy_publisher(publisher)


class Slow(Spy):
    """A device that takes its time to recover, and loses a reply where that is asked for."""

    def __init__(self):
        super().__init__()
        self.asked, self.go, self.losing, self.reads = threading.Event(), threading.Event(), False, 0

    def read(self):
        self.reads += 1
        if self.losing:
            self.losing = False
            raise NoReply("no reply to read")
        return super().read()

    def recover(self):
        self.asked.set()
        assert self.go.wait(20.0)


@pytest.fixture
def slow(drive, monkeypatch):
    """An active driver of such a device."""
    device = Slow()
    monkeypatch.setattr(driver, "DEVICES", {"simulated": lambda values: device})
    yield device, *drive("slow")
    device.go.set()


def test_a_deactivation_gets_through_while_a_service_takes_long(slow, listener):
    device, program, node = slow
    program.joints[0].drive.stop()
    client = listener.node.create_client(Trigger, "/slow/slow/clear_fault")
    listener.until(client.service_is_ready)
    future = client.call_async(Trigger.Request())
    listener.until(device.asked.is_set)
    node.trigger_deactivate()
    assert node._state_machine.current_state[1] == "inactive" and not future.done()
    device.go.set()
    listener.until(future.done)
    assert future.result().success and not device.on and not program.joints[0].guarded.enabled


def test_a_lost_reply_raises_the_level_and_is_named(slow, listener):
    device, program, _ = slow
    program.joints[0].report()
    device.losing = True
    listener.until(lambda: program.joints[0].guarded.cycles["failed_reads"] == 1)
    report = program.joints[0].report()
    assert "1 reads lost" in report.summary and report.level == b"\x01"


def test_the_flag_has_a_stamped_companion(listener):
    flags = Flags(listener.node)
    heard = listener.hear(JointState, "pure_torque_stamped", LATCHED)
    flags.show(5 * 10**9 + 7, True)
    listener.until(lambda: heard and heard[-1].effort[0] == 1.0)
    assert stamp_of(heard[-1].header.stamp) == 5 * 10**9 + 7
