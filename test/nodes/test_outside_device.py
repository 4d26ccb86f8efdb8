"""A device from outside the package in the driver node: asked for protection, its spring published as ft."""

from pathlib import Path

import pytest

from msg_adapters.ros import JointState, WrenchStamped, torque_command_message
from rsea_ros.nodes import driver
from rsea_ros.nodes._qos import COMMAND, MEASUREMENT

TOY = Path(__file__).resolve().parents[1] / "hardware" / "toy_device.py"
VALUES = {parameter.name: parameter.default for parameter in driver.TABLE} | {
    "device": "toy", "rate": 200.0, "autostart": True, "resume": True, "command_timeout": 5.0,
    "deflection_limit": 0.0,
}  # fmt: skip


@pytest.fixture
def drive(make_driver, monkeypatch):
    """A function that makes a driver of a toy."""
    monkeypatch.setenv("RSEA_DEVICES", str(TOY))
    return lambda **values: make_driver("toy", VALUES | values)


def test_a_device_without_protection_is_not_configured(drive):
    program, node = drive()
    assert node._state_machine.current_state[1] == "unconfigured"
    assert "dead-host protection none" in program.joints[0].report()[1]


def test_a_limit_of_what_the_device_does_not_measure_is_refused(drive):
    values = {"allow_no_dead_host_protection": True, "device_options": "blind=temperature"}
    program, node = drive(**values)
    assert node._state_machine.current_state[1] == "unconfigured"
    assert "parameter temperature_limit = 70 cannot be applied" in program.joints[0].report()[1]
    _, node = drive(**values, temperature_limit=0.0)
    assert node._state_machine.current_state[1] == "active"


def test_the_deflection_is_published_also_as_an_ft_marked_as_such(drive, listener):
    program, _ = drive(allow_no_dead_host_protection=True, axis="-torque.y")
    wrenches = listener.hear(WrenchStamped, "/toy/ft", MEASUREMENT)
    deflections = listener.hear(JointState, "/toy/deflection", MEASUREMENT)
    commands = listener.node.create_publisher(JointState, "/toy/torque_command", COMMAND)

    def push_commands():
        commands.publish(torque_command_message(0, 10.0))
        return wrenches and wrenches[-1].wrench.torque.y < -15.0 and deflections[-1].position[0] > 0.0099

    listener.until(push_commands)
    assert (deflections[-1].name, list(deflections[-1].position)) == (["joint"], [0.01])
    assert not deflections[-1].velocity and deflections[-1].header.frame_id == "spring_deflection"
    assert wrenches[-1].wrench.torque.z == 0.0, "torque.z"
    assert wrenches[-1].wrench.torque.y == pytest.approx(-1530.456 * 0.01)
    assert wrenches[-1].header.frame_id == "spring_deflection"
    values = program.joints[0].report().values
    assert str(values["dead_host_protection"]) == "none"
    assert values["ft_source"] == "stiffness of 1530 N·m/rad times measured deflection"
    assert "toy" in values
