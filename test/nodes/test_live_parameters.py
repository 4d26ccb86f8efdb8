"""Parameters of running nodes: limits go down at once and up without torque, and a refusal says why."""

import pytest
from rclpy.lifecycle import LifecycleNode

from msg_adapters.ros import JointState, torque_command_message
from rsea_ros.nodes import driver
from rsea_ros.nodes._joints import joint_table
from rsea_ros.nodes._parameters import declare
from rsea_ros.nodes._qos import COMMAND
from test.nodes.test_driver import Spy


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
