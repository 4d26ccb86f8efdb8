"""The driver's lifecycle on a device that keeps what is written, and its torque on every way out of it."""

import re
import time

import pytest
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.qos import qos_profile_sensor_data

from msg_adapters.ros import OK, WARN, JointState, torque_command_message
from rsea_ros.hardware.device import State
from rsea_ros.hardware.protection import PROCESS, Protection
from rsea_ros.nodes import driver
from rsea_ros.nodes._qos import COMMAND


class Spy:
    """A device that keeps what is written to it; `fault` is raised by the next reading."""

    protection = Protection(PROCESS)

    def __init__(self):
        self.written, self.opened, self.fault = [], False, None

    def open(self):
        self.opened = True

    def read(self):
        if self.fault is not None:
            raise self.fault
        return State(0, 0.0, 0.0, 0.0)

    def write(self, torque):
        self.written.append(torque)

    def enable(self):
        self.on = True

    def disable(self):
        self.written.append(0.0)
        self.on = False

    def zero_ft(self):
        self.zeroed = True

    def recover(self):
        if self.fault is not None:
            raise self.fault

    reboot = recover

    def health(self):
        return {}

    def close(self):
        if self.opened:
            self.written.append(0.0)
        self.opened = False


@pytest.fixture
def spied(listener, make_driver, monkeypatch):
    """An active driver in this process that has written 5 N m to a spy."""
    spy = Spy()
    monkeypatch.setattr(driver, "DEVICES", {"simulated": lambda values: spy})
    values = {parameter.name: parameter.default for parameter in driver.TABLE}
    given = {"rate": 200.0, "autostart": True, "resume": True, "command_timeout": 5.0}
    program, node = make_driver("spied", values | given)
    publisher = listener.node.create_publisher(JointState, "/spied/torque_command", COMMAND)

    def push_commands():
        publisher.publish(torque_command_message(0, 5.0))
        return 5.0 in spy.written

    listener.until(push_commands)
    return spy, program, node


def test_a_free_end_without_a_position_limit_is_not_activated_unless_that_is_asked_for(
    make_driver, monkeypatch
):
    monkeypatch.setattr(driver, "DEVICES", {"simulated": lambda values: Spy()})
    values = {p.name: p.default for p in driver.TABLE} | {"rig": "bare_drive", "autostart": True}
    told = {}
    for name, given in (
        ("free", {}), ("allowed", {"allow_no_position_limit": True}), ("limited", {"position_limit": 1.0}),
    ):  # fmt: skip
        program, node = make_driver(name, values | given)
        told[name] = node._state_machine.current_state[1]
    assert told == {"free": "inactive", "allowed": "active", "limited": "active"}
    shown = program.joints[0].report().values
    assert shown["refused"] == 0 and "position_limit 1 rad, deflection_limit none" in str(shown["limits"])


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
    values = {p.name: p.default for p in driver.TABLE} | {"rate": 100.0}
    (first, node), (second, other) = (make_driver("twin", values | {"autostart": k == 0}) for k in range(2))
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
