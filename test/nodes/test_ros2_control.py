"""ros2_control in front of the driver: config/ros2_control, and what its topic systems send and read.

Their rules are written anew from the documentation of `trigger_joint_command_threshold` and the changelogs:
nothing is sent while a sum of |state - command| is at most the threshold. ros2_control itself has no wheels.
"""

import math
import re
import time
from pathlib import Path
from xml.etree import ElementTree

import pytest
import yaml

from msg_adapters.ros import JointState, torque_command_message
from rsea_ros.nodes import driver
from rsea_ros.nodes._devices import limits_of
from rsea_ros.nodes._qos import MEASUREMENT
from test.nodes.on_wire import PATIENT, Driven
from test.nodes.stalls import is_stall
from test.nodes.warm import Bench

CONFIG = Path(__file__).resolve().parents[2] / "config" / "ros2_control"
DEFAULTS = {parameter.name: parameter.default for parameter in driver.TABLE}
SUMS = {
    "0.2.0": lambda position, effort, command: abs(position),  # a position that nobody commands is 0 there
    "1.0.0": lambda position, effort, command: 0.0,  # of commanded positions only
    "1.1.0": lambda position, effort, command: abs(effort - command),
}
"""By release: what it compares with the threshold, of a joint that has an effort command."""


def sends(release, threshold, position, effort, command):
    """Whether a release sends a command in a cycle; a sum that is NaN is not below any threshold."""
    return not SUMS[release](position, effort, command) <= threshold


@pytest.fixture(scope="module")
def robot():
    """The xacro with the defaults of its arguments filled in."""
    text = (CONFIG / "rsea.urdf.xacro").read_text()
    given = dict(re.findall(r'<xacro:arg name="(\w+)" default="([^"]*)"/>', text))
    return ElementTree.fromstring(re.sub(r"\$\(arg (\w+)\)", lambda match: given[match[1]], text))


@pytest.fixture(scope="module")
def threshold(robot):
    """The threshold of the system that commands."""
    return float(robot.find("ros2_control/hardware/param[@name='trigger_joint_command_threshold']").text)


def test_the_description_has_topics_names_and_limits_of_the_driver(robot):
    names = {param.get("name"): param.text for param in robot.findall("ros2_control/hardware/param")}
    assert names["joint_commands_topic"] == "/rsea/torque_command"
    assert names["joint_states_topic"] == "/rsea/joint_states"
    (joint,) = robot.findall("ros2_control/joint")
    assert joint.get("name") == DEFAULTS["joint"] == robot.find("joint").get("name")
    assert [one.get("name") for one in joint.findall("command_interface")] == ["effort"]
    assert [one.get("name") for one in joint.findall("state_interface")] == ["position", "velocity", "effort"]
    assert float(joint.find("command_interface/param[@name='initial_value']").text) == 0.0
    stated, limits = robot.find("joint/limit"), limits_of(DEFAULTS)
    assert float(stated.get("effort")) == limits.torque and float(stated.get("velocity")) >= limits.velocity


def test_the_estimates_are_states_without_a_command(robot):
    (system,) = (one for one in robot.iter("ros2_control") if one.get("name") == "rsea_torque")
    assert system.find("hardware/param[@name='joint_states_topic']").text == "/rsea/torque_estimate"
    assert not list(system.iter("command_interface"))
    (joint,) = system.findall("joint")
    assert joint.get("name") == "distal" and joint.find("state_interface").get("name") == "effort"


def test_the_controllers_are_of_kinds_that_every_distribution_has_and_of_the_joint():
    text = yaml.safe_load((CONFIG / "controllers.yaml").read_text())
    manager = text.pop("controller_manager")["ros__parameters"]
    assert manager.pop("update_rate") == DEFAULTS["rate"] > 1.0 / DEFAULTS["command_timeout"]
    assert set(text) < set(manager)
    assert manager["effort_controller"] == {"type": "forward_command_controller/ForwardCommandController"}
    assert text["effort_controller"]["ros__parameters"] == {
        "joints": [DEFAULTS["joint"]], "interface_name": "effort",
    }  # fmt: skip
    torque = text["torque_broadcaster"]["ros__parameters"]["interface_names"]["torque"]
    assert torque == {"z": "distal/effort"}


@pytest.mark.parametrize("release", SUMS)
def test_a_constant_torque_at_rest_is_sent_with_the_threshold_of_the_description_and_not_with_zero(
    release, threshold
):
    """The documentation said 0: at rest 184 of 560 cycles, and the driver took the controller for dead."""
    at_rest = {"position": 0.0, "effort": 2.0, "command": 2.0}
    assert sends(release, threshold, **at_rest) and not sends(release, 0.0, **at_rest)


class System(Driven):
    """A driver that a topic system commands, stamped with the time of sending. states: its joint_states."""

    stamp = staticmethod(time.time_ns)
    threshold, sent, kept = math.nan, 0, 0

    def publish(self, torque):
        """Write, as a cycle of ros2_control does after it has read."""
        read = (self.states[-1].position[0], self.states[-1].effort[0]) if self.states else (0.0, 0.0)
        if all(sends(release, self.threshold, *read, torque) for release in SUMS):
            self.sent += 1
            self._commands.publish(torque_command_message(self.stamp(), torque, self.joint))
        else:
            self.kept += 1


@pytest.fixture(scope="module")
def system(tmp_path_factory, start, listener, threshold):
    """A system in front of a motor with an encoder of 12 bits."""
    with Bench(tmp_path_factory.mktemp("control") / "tty", "--model", 1120) as bench:
        given = PATIENT | {"command_timeout": 0.5, "voltage_limit": 0.0}
        made = System(bench, listener, "control", start, given)
        made.states = listener.hear(JointState, "/control/joint_states", MEASUREMENT)
        made.threshold = threshold
        yield made


def test_nan_before_a_controller_writes_is_refused_without_a_line_each(system):
    """1.1.0 sends it where no initial value is stated."""
    system.push(lambda: int(system.value("refused_commands") or 0) > 100, torque=math.nan)
    assert system.goal()[0] == 0 and system.sent > 100
    told = [line for line in system.process.output if not is_stall(line.partition(" fault ")[2])]
    assert not [line for line in told if "torque_command" in line or "refused" in line]


def test_a_constant_torque_stays_in_force(system):
    """Also from rest, where the position is exactly 0 and a threshold of 0 sends nothing."""
    system.push(lambda: system.goal()[0] == 0 and system.states[-1].position[0] == 0.0, torque=0.0)
    begun = None

    def is_held():
        nonlocal begun
        acts = system.states[-1].effort[0] > 1.5 and system.value("fault") == "none"
        begun = (begun or len(system.states)) if acts else None
        return begun is not None and len(system.states) > begun + 150  # three times command_timeout

    system.push(is_held, torque=2.0)
    assert not system.kept
