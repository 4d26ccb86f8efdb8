"""A driven joint without ROS: its report, its log, its services, and a stop that a motor confirms."""

from __future__ import annotations

from contextlib import contextmanager
from types import SimpleNamespace

import pytest

from rsea_ros.errors import DeviceError, RseaError
from rsea_ros.nodes import _joint as module
from rsea_ros.nodes._health import ERROR, OK, WARN, NodeHealth
from rsea_ros.nodes._joint import DrivenJoint, _hardware, stop


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

    joint.drive = SimpleNamespace(deaf=deaf, stop=lambda *, is_answered: calls.append(("stop", is_answered)))
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
        "active": True, "fault": "none", "dead_host_protection": "watchdog", "ft_source": "sensor",
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
    assert calls == [("stop", False)] and waits == [0.05]
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
