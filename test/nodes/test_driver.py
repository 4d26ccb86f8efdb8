"""The driver in this process: zero torque on every way out, names, floods, devices from outside."""

import math
import re
import threading
import time
from functools import partial
from pathlib import Path

import pytest
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.parameter import Parameter
from rclpy.qos import ReliabilityPolicy, qos_profile_sensor_data
from std_msgs.msg import Float64MultiArray, MultiArrayDimension, MultiArrayLayout

from msg_adapters.ros import OK, WARN, JointState, Trigger, WrenchStamped, stamp_of, torque_command_message
from msg_adapters.topic_map import FLOATS
from rsea_ros.hardware.device import NoReply
from rsea_ros.hardware.protection import PROCESS, Protection
from rsea_ros.nodes import driver
from rsea_ros.nodes._bench_topics import MOST, NAMES, BenchTopics
from rsea_ros.nodes._cycle import Anchor
from rsea_ros.nodes._qos import COMMAND, LATCHED, MEASUREMENT
from rsea_ros.nodes.model import Flags
from test.nodes.monitor import FakeMotor

SERVES = True


class Spy(FakeMotor):
    """A motor that keeps what is written to it; `fault` is raised by the next reading."""

    protection = Protection(PROCESS)

    def __init__(self):
        super().__init__()
        self.written, self.opened, self.fault = [], False, None

    def _reached(self, moment):
        super()._reached(moment)
        if moment in ("read", "recover") and self.fault is not None:
            raise self.fault

    def open(self):
        self.opened = True

    def write(self, torque):
        super().write(torque)
        self.written.append(torque)

    def disable(self):
        super().disable()
        self.written.append(0.0)

    def close(self):
        if self.opened:
            self.written.append(0.0)
        self.opened = False


@pytest.fixture
def spied(listener, make_driver, monkeypatch):
    """An active driver in this process that has written 5 N m to a spy."""
    spy = Spy()
    monkeypatch.setattr(driver, "DEVICES", {"simulated": lambda values: spy})
    program, node = make_driver("spied")
    publisher = listener.node.create_publisher(JointState, "/spied/torque_command", COMMAND)
    listener.until(lambda: 5.0 in spy.written, lambda: publisher.publish(torque_command_message(0, 5.0)))
    return spy, program, node


def test_a_free_end_without_a_position_limit_is_not_activated_unless_that_is_asked_for(
    make_driver, monkeypatch
):
    monkeypatch.setattr(driver, "DEVICES", {"simulated": lambda values: Spy()})
    told = {}
    for name, given in (
        ("free", {}), ("allowed", {"allow_no_position_limit": True}), ("limited", {"position_limit": 1.0}),
    ):  # fmt: skip
        program, node = make_driver(name, rig="bare_drive", **given)
        told[name] = node._state_machine.current_state[1]
    assert told == {"free": "inactive", "allowed": "active", "limited": "active"}
    shown = program.joints[0].report().values
    assert shown["refused"] == 0 and "position_limit 1 rad, deflection_limit none" in str(shown["limits"])


def test_a_stop_before_configure_is_kept_until_a_clear(listener, make_driver, monkeypatch):
    """It was answered that the driver is not configured, and forgotten: an activation made torque."""
    monkeypatch.setattr(driver, "DEVICES", {"simulated": lambda values: Spy()})
    program, node = make_driver("early", autostart=False)
    state = lambda: node._state_machine.current_state[1]  # noqa: E731
    told = listener.call("/early/early/stop")
    assert told.success and "torque zero until clear_fault, the driver is not configured" in told.message
    assert not listener.call("/early/early/clear_fault").success
    node.trigger_configure()
    node.trigger_activate()
    assert state() == "inactive" and program.joints[0].report().values["fault"].cause == "stopped"
    assert listener.call("/early/early/clear_fault").success
    node.trigger_activate()
    assert state() == "active"


@pytest.mark.parametrize("way", ["trigger_deactivate", "trigger_shutdown"])
def test_every_transition_out_of_active_writes_zero(spied, way):
    spy, _, node = spied
    getattr(node, way)()
    assert spy.written[-1] == 0.0


def test_after_an_exception_the_device_is_closed_at_zero_torque_and_can_be_configured_again(spied, listener):
    spy, program, node = spied
    assert program.joints[0].report().values["lifted_limits"] == "temperature, current, voltage"
    spy.fault = ZeroDivisionError("a mistake in the program")
    listener.until(lambda: not spy.opened)
    assert spy.written[-1] == 0.0
    program.is_finished()
    assert node._state_machine.current_state[1] == "unconfigured"
    assert program.joints[0].report()[1] == "a mistake in the program"
    spy.fault = None
    node.trigger_configure()
    assert node._state_machine.current_state[1] == "inactive" and spy.opened


def test_a_second_driver_of_one_name_is_told_by_both_and_not_activated(listener, make_driver, monkeypatch):
    """Both published joint_states and moved what they had; nobody said a word."""
    monkeypatch.setattr(driver, "DEVICES", {"simulated": lambda values: Spy()})
    (first, node), (second, other) = (make_driver("twin", autostart=k == 0) for k in range(2))
    other.trigger_configure()
    told = "2 nodes are called /twin/twin and publish joint_states, expected one"
    for program in (first, second):
        listener.until(lambda program=program: told in program.joints[0].report().summary)
    other.trigger_activate()
    assert other._state_machine.current_state[1] == "inactive"
    assert node._state_machine.current_state[1] == "active"
    other.trigger_cleanup()
    listener.until(lambda: told not in first.joints[0].report().summary)


def test_a_client_that_stamps_when_it_sends_keeps_no_driver_in_warn_and_one_that_is_late_does(
    spied, listener, reports
):
    """Half of its commands come after the cycle of their stamp: a healthy driver was in WARN for ever."""
    publisher = listener.node.create_publisher(JointState, "/spied/torque_command", COMMAND)
    listener.until(publisher.get_subscription_count)

    def level(*offsets):
        """The level and line of a report after commands stamped so many s from now."""
        reports(spied)
        for k in range(40):
            stamp = time.time_ns() + round(offsets[k % len(offsets)] * 1e9)
            publisher.publish(torque_command_message(stamp, 5.0))
            end = time.monotonic() + 0.005
            listener.until(lambda end=end: time.monotonic() > end)
        return reports(spied)

    for timer in spied[2].timers:
        timer.cancel()  # of the node's own reports, each of which is of what is new
    listener.until(lambda: "stamped when sent" in level(-0.003).summary)  # it is heard, and obeyed
    report = level(-0.003)
    assert report.level == OK and "stamped when sent act on arrival" in report.summary, report
    assert int(report.values["late_commands"]) > 10, "a bag says all the same that its stamps are wrong"
    for offsets in ((-0.003, 0.01), (-0.1,)):
        report = level(*offsets)
        assert report.level == WARN and "commands late" in report.summary, report


@pytest.fixture
def reports():
    """A function that returns the health of a spied driver's topics, without what a busy machine adds."""

    def ask(spied):
        joint = spied[1].joints[0]
        report = joint.topics.report(joint._cycle)
        told = re.sub(r"^\d+ cycles missed(, )?", "", report.summary)
        return report._replace(summary=told, level=OK if told[:1] in ("", ";") else report.level)

    return ask


def test_a_publisher_whose_qos_does_not_fit_is_told(spied, listener, capfd):
    """A client with the sensors' QoS commanded, and nothing happened: no line anywhere."""
    _, program, _ = spied
    quiet = PublisherEventCallbacks(use_default_callbacks=False)
    where = JointState, "/spied/torque_command", qos_profile_sensor_data
    publisher = listener.node.create_publisher(*where, event_callbacks=quiet)
    told = "torque_command: nothing is heard of listener, whose QoS does not fit"
    published = []
    health = program.joints[0]._health
    health._publisher = type("", (), {"publish": lambda self, message: published.append(message)})()
    listener.until(lambda: health.publish() or any(told in m.status[0].message for m in published))
    assert published[-1].status[0].level >= WARN
    listener.node.destroy_publisher(publisher)
    published.clear()
    listener.until(lambda: health.publish() or told not in published[-1].status[0].message)
    assert told in capfd.readouterr().err


def test_joint_frames_and_quality_of_service_are_parameters(make_driver, listener):
    best_effort = Parameter("qos_overrides./named/ft.publisher.reliability", value="best_effort")
    make_driver("named", best_effort, joint="left_knee", frame="thigh", ft_frame="shank")
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


NAMED = {parameter.name: parameter.default for parameter in NAMES}


def test_a_cycle_takes_a_bounded_number_of_commands_and_the_newest_acts(listener, monkeypatch):
    """20 kHz of commands stopped the cycle for as long as they lasted."""
    bench, anchor = BenchTopics(listener.node, NAMED, strict=True), Anchor()
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
    bench = BenchTopics(listener.node, NAMED | {"command_type": FLOATS, "torque_limit": 68.0}, strict=True)
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
def slow(make_driver, monkeypatch):
    """An active driver of such a device."""
    device = Slow()
    monkeypatch.setattr(driver, "DEVICES", {"simulated": lambda values: device})
    yield device, *make_driver("slow", effort_limit=0.0)
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


TOY = Path(__file__).resolve().parents[1] / "hardware" / "toy_device.py"


@pytest.fixture
def toy(make_driver, monkeypatch):
    """A function that makes a driver of a toy."""
    monkeypatch.setenv("RSEA_DEVICES", str(TOY))
    return partial(make_driver, "toy", device="toy", deflection_limit=0.0)


def test_a_device_without_protection_is_not_configured(toy):
    program, node = toy()
    assert node._state_machine.current_state[1] == "unconfigured"
    assert "dead-host protection none" in program.joints[0].report()[1]


def test_a_limit_of_what_the_device_does_not_measure_is_refused(toy):
    values = {"allow_no_dead_host_protection": True, "device_options": "blind=temperature"}
    program, node = toy(**values)
    assert node._state_machine.current_state[1] == "unconfigured"
    assert "parameter temperature_limit = 70 cannot be applied" in program.joints[0].report()[1]
    _, node = toy(**values, temperature_limit=0.0)
    assert node._state_machine.current_state[1] == "active"


def test_the_deflection_is_published_also_as_an_ft_marked_as_such(toy, listener):
    program, _ = toy(allow_no_dead_host_protection=True, axis="-torque.y")
    wrenches = listener.hear(WrenchStamped, "/toy/ft", MEASUREMENT)
    deflections = listener.hear(JointState, "/toy/deflection", MEASUREMENT)
    commands = listener.node.create_publisher(JointState, "/toy/torque_command", COMMAND)
    def is_bent():
        return wrenches and wrenches[-1].wrench.torque.y < -15.0 and deflections[-1].position[0] > 0.0099

    listener.until(is_bent, lambda: commands.publish(torque_command_message(0, 10.0)))
    assert (deflections[-1].name, list(deflections[-1].position)) == (["joint"], [0.01])
    assert not deflections[-1].velocity and deflections[-1].header.frame_id == "spring_deflection"
    assert wrenches[-1].wrench.torque.z == 0.0, "torque.z"
    assert wrenches[-1].wrench.torque.y == pytest.approx(-1530.456 * 0.01)
    assert wrenches[-1].header.frame_id == "spring_deflection"
    values = program.joints[0].report().values
    assert str(values["dead_host_protection"]) == "none"
    assert values["ft_source"] == "stiffness of 1530 N·m/rad times measured deflection"
    assert "toy" in values
