"""Several nodes in one process: what they take, what they do, and parameters that change meanwhile."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from rclpy.executors import SingleThreadedExecutor

from rsea_ros.errors import ParameterError
from rsea_ros.nodes._run import PROFILE
from rsea_ros.nodes.joint import compose
from test.nodes.conftest import QUICK, ROOT, as_argument
from test.nodes.test_live_parameters import put
from test.nodes.torque_loop import GAINS, Loop

__all__ = ["put"]
LARGEST = 250e6
"""B that driver, controller and model of a joint may take together; as three processes they took 600."""
GIVEN = {
    "device": "simulated", "autostart": True, "resume": True, "command_timeout": 5.0, "late_share": 1.0,
    "stale": 1.0, "error_limit": 0.0, **GAINS,
}  # fmt: skip
"""A machine that is busy with other tests must not look like a fault."""


@pytest.fixture(scope="module")
def joint(listener, tmp_path_factory):
    """A driver, a controller and a model in a process that nothing else was loaded into."""
    words = [w for key, value in GIVEN.items() for w in ("-p", f"{key}:={as_argument(value)}")]
    command = [sys.executable, "-m", "rsea_ros.nodes.joint", "driver", "controller", "model", "--ros-args"]
    environment = {**os.environ, PROFILE: QUICK[PROFILE], "PYTHONPATH": str(ROOT)}
    environment["ROS_LOG_DIR"] = str(tmp_path_factory.mktemp("log"))
    topics = Loop(listener, stalls=("more than 1 sample late", "no usable measurement"))
    topics.start = lambda: subprocess.Popen([*command, *words], env=environment)
    topics.process = topics.start()
    yield topics
    topics.process.kill()
    topics.process.wait()


def torque(topics):
    """The newest torque that is commanded."""
    return topics.commands[-1].effort[0] if topics.commands else 0.0


def test_a_joint_is_controlled_in_one_process_of_250_megabytes(joint):
    joint.ready()
    joint.hold(6.0, lambda: abs(joint.wrenches[-1].wrench.torque.z - 6.0) < 0.5)
    names = {"/rsea/driver", "/rsea/controller", "/rsea/model"}
    joint.hold(6.0, lambda: names <= {status.name for m in joint.health for status in m.status})
    if resident(joint) > LARGEST:  # of a fresh clone: a process that compiled keeps the compiler
        joint.process.send_signal(signal.SIGINT)
        joint.process.wait()
        joint.process = joint.start()
        joint.wrenches.clear()
        joint.ready()
        joint.hold(6.0, lambda: abs(joint.wrenches[-1].wrench.torque.z - 6.0) < 0.5)
    assert resident(joint) < LARGEST


def resident(joint):
    """Memory of the process, B."""
    status = Path(f"/proc/{joint.process.pid}/status").read_text()
    return 1024 * int(status.split("VmRSS:")[1].split()[0])


def test_gains_change_under_torque_without_a_jump_and_only_to_stable_ones(joint, put, listener):
    assert "unstable at 280 Hz" in put("/rsea/controller", k_p=30.0)
    sender = listener.node.create_timer(0.01, lambda: joint.desire(6.0))
    try:
        assert any(changed_smoothly(joint, put, share) for share in (0.9, 0.95, 0.85, 1.0))
    finally:
        listener.node.destroy_timer(sender)


def changed_smoothly(joint, put, share):
    """Whether gains changed without a jump; a machine that stalls for some cycles makes one, too."""
    joint.hold(6.0, lambda: all(abs(m.wrench.torque.z - 6.0) < 0.3 for m in joint.wrenches[-60:]))
    begun = len(joint.commands)
    assert put("/rsea/controller", k_p=share * GAINS["k_p"], k_i=share * GAINS["k_i"]) == ""
    joint.hold(6.0, lambda: len(joint.commands) > begun + 280)
    torques = [message.effort[0] for message in joint.commands[begun:]]
    return 5.0 < min(torques) < max(torques) < 7.0


def test_a_limit_of_the_controller_goes_down_under_torque_and_up_without(joint, put, listener):
    assert put("/rsea/controller", torque_limit=4.0) == ""
    joint.hold(6.0, lambda: torque(joint) == 4.0)
    assert "raised under torque, expected clear_fault" in put("/rsea/controller", torque_limit=5.0)
    listener.call("/rsea/controller/clear_fault")
    assert put("/rsea/controller", torque_limit=5.0) == ""
    joint.hold(6.0, lambda: torque(joint) == 5.0)


def test_the_tolerance_of_the_flag_changes_while_it_is_up(joint, put):
    def told():
        status = [s for message in joint.health for s in message.status if s.name == "/rsea/model"][-1]
        return {pair.key: pair.value for pair in status.values}["tolerance"]

    assert told() == "0.3"
    assert put("/rsea/model", tolerance=0.2) == ""
    joint.hold(6.0, lambda: told() == "0.2")


def test_one_signal_ends_all_of_them_at_zero_torque(joint, listener):
    joint.process.send_signal(signal.SIGINT)
    listener.until(lambda: joint.process.poll() is not None)
    assert joint.process.returncode == 0
    listener.until(lambda: torque(joint) == 0.0)


def test_nodes_are_made_in_a_process_and_executor_of_ones_own(listener):
    """Two of a kind, each with a name, a namespace and parameters of its own."""
    executor = SingleThreadedExecutor()
    left, right = (
        compose("model", executor, {"quiet": quiet}, name="observer", namespace=side)
        for side, quiet in (("left", 2.0), ("right", 5.0))
    )
    try:
        assert left.node.get_fully_qualified_name() == "/left/observer"
        assert len(executor.get_nodes()) == 2
        assert [each.node.get_parameter("quiet").value for each in (left, right)] == [2.0, 5.0]
        with pytest.raises(ParameterError, match=r"parameter quite: .*, did you mean quiet"):
            compose("model", executor, {"quite": 2.0})
        with pytest.raises(ParameterError, match=r"node 'modle', expected one of .*, did you mean model"):
            compose("modle", executor)
    finally:
        left.close()
        right.close()
    assert not executor.get_nodes()
    executor.shutdown()
