"""Several nodes in one process, and a driven joint without ROS."""

import os
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import pytest
from rclpy.executors import SingleThreadedExecutor

from rsea_ros.errors import DeviceError, ParameterError, RseaError
from rsea_ros.nodes import _joint as module
from rsea_ros.nodes._health import ERROR, OK, WARN, NodeHealth
from rsea_ros.nodes._joint import DrivenJoint, _hardware, stop
from rsea_ros.nodes.joint import compose
from test.nodes.conftest import ROOT, as_argument, setting
from test.nodes.stalls import until
from test.nodes.torque_loop import GAINS, Loop
from test.nodes.warm import parent

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
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
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


def test_a_stop_is_heard_while_gains_are_designed(joint, put, listener):
    """It was answered after the design, 2.8 to 3.5 s late: that had the executor of both nodes."""
    assert put("/rsea/controller", k_p=GAINS["k_p"], k_i=GAINS["k_i"]) == ""
    for service in ("stop", "clear_fault"):  # answers to clients that a node has not found yet are lost
        assert listener.call(f"/rsea/driver/{service}").success
    every = setting(**dict.fromkeys(GAINS, -1.0))
    designed = listener.clients["/rsea/controller/set_parameters_atomically"].call_async(every)
    for _ in range(2):
        begun = time.monotonic()
        assert listener.call("/rsea/driver/stop").success
        assert time.monotonic() - begun < 0.5 and not designed.done()
    listener.until(designed.done)
    assert designed.result().result.successful
    assert listener.call("/rsea/driver/clear_fault").success


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


def test_a_driver_is_made_last_in_whatever_order_they_are_named(tmp_path):
    """Named after the controller it was active while that designed its gains, and heard no stop."""
    words = [w for key, value in GIVEN.items() for w in ("-p", f"{key}:={as_argument(value)}")]
    words = ["controller", "driver", "--ros-args", *words, "-r", "__ns:=/last"]
    (log := tmp_path / "log").touch()
    made = parent().start("rsea_ros.nodes.joint", words, dict(os.environ), (os.devnull, log, log))
    until(lambda: "limits: " in log.read_text() and "tolerated: " in log.read_text())
    made.send_signal(signal.SIGINT)
    assert made.wait() == 0
    said = log.read_text()
    assert said.index("tolerated: ") < said.index("limits: ")


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


def test_a_second_driver_of_one_name_does_not_live(listener):
    """It answered a stop by "not configured", success, while the motor of the first one turned."""
    make = partial(compose, "driver", listener.executor, name="only", namespace="one")
    for _ in range(2):
        first = make()
        with pytest.raises(RseaError, match="a node called /one/only runs on this machine, expected none"):
            make()
        first.close()


class Limits(SimpleNamespace):
    """Limits with words."""

    def __str__(self):
        return "limits in words"


@pytest.fixture
def made():
    """Return a joint whose device and topics are stubs, and what it did."""
    calls, joint = [], DrivenJoint.__new__(DrivenJoint)
    logger = SimpleNamespace(**{
        n: lambda text, n=n, **k: calls.append((n, text)) for n in ("info", "warning", "error")
    })  # fmt: skip
    joint._node = SimpleNamespace(get_logger=lambda: logger)
    joint.part, joint._ended, joint._double, joint._reported = "", "", "", (None, 0)
    joint._offers = []
    joint._health = SimpleNamespace(publish=lambda: calls.append("health"))
    guard = SimpleNamespace(limited=0, limits=Limits(torque=8.0, slew=300.0), refused=2)
    joint.guarded = SimpleNamespace(
        fault=None, cycles={"failed_reads": 3, "failed_writes": 4}, enabled=True, ft_source="sensor",
        lifted=(), guard=guard, contradiction="", interlock=SimpleNamespace(stopped=False),
        device=SimpleNamespace(protection="watchdog", health=lambda: {"motor": "X"}), is_off=True, away=False,
        clear=lambda asked: calls.append(("clear", asked)), reboot=lambda: calls.append("reboot"),
        zero_ft=lambda: calls.append("zero_ft"),
    )  # fmt: skip

    @contextmanager
    def deaf():
        calls.append("deaf")
        yield

    joint.drive = SimpleNamespace(deaf=deaf, stop=lambda: calls.append("stop"), zero_first=False)
    joint._cycle = SimpleNamespace(rest=lambda: calls.append("rest"))
    asked = []
    joint.topics = SimpleNamespace(
        namesakes=SimpleNamespace(look=lambda: ""),
        report=lambda cycle, lost: asked.append(lost) or NodeHealth(OK, "running", {"late": 1}), asked=asked)
    return joint, calls


def test_the_report_has_device_guard_and_topics(made):
    joint, calls = made
    report = joint.report()
    assert calls == ["rest"] and joint.topics.asked == [{"reads lost": 3, "writes lost": 4}]
    assert report == NodeHealth(OK, "running", {
        "active": True, "zero_first": False, "fault": "none", "dead_host_protection": "watchdog",
        "ft_source": "sensor",
        "lifted_limits": "none", "limited_commands": 0, "failed_reads": 3, "failed_writes": 4, "late": 1,
        "refused": 2, "limits": joint.guarded.guard.limits, "torque_limit": "8", "motor": "X",
    })  # fmt: skip
    joint.guarded.contradiction, joint.guarded.lifted = "ft is off", ("slew", "torque")
    report = joint.report()
    assert (report.level, report.summary) == (WARN, "ft is off")
    assert report.values["lifted_limits"] == "slew, torque"
    joint.guarded.fault = "hot"
    joint.topics.report = lambda cycle, lost: joint.topics.asked.append(lost) or NodeHealth(WARN, "late", {})
    report = joint.report()
    assert (report.level, report.summary) == (ERROR, "fault hot; late")
    assert report.values["fault"] == "hot" and joint.topics.asked[-1] == {}
    joint._cycle = None
    assert joint.report() == NodeHealth(OK, "not configured", {})
    joint.fail(OSError("the port\n is gone"))
    assert joint.report() == NodeHealth(ERROR, "the port is gone", {})
    assert calls[-1] == ("error", "the port is gone")


def test_a_fault_and_commands_that_were_cut_are_told_once(made):
    joint, calls = made
    joint.follow()
    assert calls == []
    joint.part, joint.guarded.fault, joint.guarded.guard.limited = "hip", "hot", 5
    joint.follow()
    joint.follow()
    cut = "hip: 5 commands limited to 8 N·m and 300 N·m/s so far"
    hot = "hip: fault hot; torque zero until clear_fault or reboot"
    assert calls == [("error", hot), "health", ("warning", cut)]
    joint.guarded.fault, joint.guarded.interlock.stopped = "stop", True
    joint.follow()
    assert calls[3:] == [("error", "hip: fault stop; torque zero until clear_fault"), "health"]


def test_services_act_on_an_open_device_alone(made):
    joint, calls = made
    assert joint.clear_fault(7) == "there is no fault; nothing was done" and calls == []
    joint.guarded.fault = "hot"
    assert joint.clear_fault(7) == "done" and calls == ["deaf", ("clear", 7)]
    assert joint._reboot(8) == "done; fault hot" and calls[2:] == ["deaf", "reboot"]
    joint.guarded.fault = None
    assert joint._reboot(8) == "done" and joint._zero_ft(9) == "done" and calls[-1] == "zero_ft"
    joint.drive = None
    for service in (joint.clear_fault, joint._reboot, joint._zero_ft):
        with pytest.raises(RseaError, match="the driver is not configured"):
            service(1)


def test_a_stop_waits_until_every_motor_is_off(made, monkeypatch):
    joint, calls = made
    now, waits = [10.0], []
    monkeypatch.setattr(module.time, "monotonic", lambda: now[0])

    def sleep(seconds):
        waits.append(seconds)
        now[0] += seconds
        joint.guarded.is_off = joint.guarded.is_off or len(waits) == 4

    monkeypatch.setattr(module.time, "sleep", sleep)
    assert stop([joint]) == "torque zero until clear_fault, the motor is off"
    assert calls == ["stop"] and waits == [0.05]
    joint.guarded.is_off = False
    waits.clear()
    stop([joint])
    assert waits == pytest.approx([0.05, *[0.005] * 3])
    joint.guarded.is_off, joint.guarded.fault, joint.part = False, "stop", "hip"
    monkeypatch.setattr(module.time, "sleep", lambda seconds: now.__setitem__(0, now[0] + seconds))
    begun = now[0]
    with pytest.raises(DeviceError, match=r"confirmed it \(hip: stop\), expected it to be off within 0\.5 s"):
        stop([joint])
    assert now[0] - begun == pytest.approx(0.55, abs=0.02)
    joint.guarded.away = True
    with pytest.raises(DeviceError, match="the motor confirms it when another service is over"):
        stop([joint])


def test_the_hardware_is_motor_port_and_sensor_or_a_simulation():
    values = {"device": "simulated", "rig": "bench", "ft_host": "", "id": 3, "port": "/dev/ttyUSB0"}
    assert _hardware(values, {}) == "simulated bench"
    assert _hardware(values, {"motor": "XM430"}) == "XM430, ID 3 on /dev/ttyUSB0"
    said = _hardware(values | {"ft_host": "10.0.0.2"}, {"motor": "XM430"})
    assert said == "XM430, ID 3 on /dev/ttyUSB0, F/T sensor at 10.0.0.2"


def test_a_joint_whose_end_nothing_limits_is_not_enabled(made, monkeypatch):
    joint, calls = made
    asked = []
    monkeypatch.setattr(module, "load_rig", lambda name: f"rig {name}")
    monkeypatch.setattr(module, "check_travel", lambda limit, rig: asked.append((limit, rig)))
    joint.guarded.enable = lambda: calls.append("enable")
    joint.guarded.guard.limits.position = 1.5
    joint._values = {"allow_no_position_limit": False, "rig": "bench"}
    joint.enable(zero_first=True)
    assert asked == [(1.5, "rig bench")] and calls == ["deaf", "enable"] and joint.drive.zero_first is True
    joint._values["allow_no_position_limit"] = True
    joint.enable()
    assert len(asked) == 1 and joint.drive.zero_first is False
    closed = joint.topics
    closed.close = lambda: calls.append("closed")
    joint.close()
    assert calls[-1] == "closed" and (joint.drive, joint.topics, joint._cycle) == (None, None, None)
    joint.close()
