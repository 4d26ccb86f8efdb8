"""Protection against a dead host: asked of every device at opening; supervisors and their services."""

import configparser
import json
import math
import os
import shlex
import signal
import socket
import subprocess
import sys
import threading
from contextlib import ExitStack, suppress
from pathlib import Path

import pytest
import yaml

from rsea_ros.errors import DeviceError, ParameterError
from rsea_ros.hardware import protection, supervisor
from rsea_ros.hardware.device import Spring
from rsea_ros.hardware.guarded import GuardedDevice
from rsea_ros.hardware.limits import Limits
from rsea_ros.hardware.outside import options_of, outside_device
from rsea_ros.hardware.protection import NONE
from rsea_ros.nodes.driver import TABLE
from test.nodes.stalls import until

TOY = Path(__file__).with_name("toy_device.py")


@pytest.fixture
def toy(monkeypatch):
    """A function that makes a toy with options, by the environment variable."""
    monkeypatch.setenv("RSEA_DEVICES", str(TOY))
    made = []

    def make(watchdog=0.1, **options):
        kind = outside_device("toy", ("simulated",))
        assert kind.feels
        made.append(kind.make({"device_options": options, "watchdog": watchdog}))
        return made[-1]

    yield make
    for device in made:
        device.close()


def guard(device, spring=None, **limits):
    return GuardedDevice(device, Limits(68.0, **limits), 280.0, spring)


def driven(toy, spring=None, limits=(), **options):
    """Return a toy and its loop, enabled, after three cycles of 10 N m."""
    device = toy(**options)
    loop = guard(device, spring, **dict(limits))
    loop.open(unprotected=True)
    loop.enable()
    for _ in range(3):
        loop.cycle(10.0, 0.0)
    return device, loop


def test_a_device_without_protection_is_refused_unless_that_is_allowed(toy):
    device = toy()
    with pytest.raises(ParameterError, match="allow_no_dead_host_protection = true"):
        guard(device).open()
    assert not device.opened, "nothing stays open"
    guard(device).open(unprotected=True)
    assert device.opened


def test_the_answer_to_a_dead_drivers_last_frame_acknowledges_nothing():
    """Answers are alike: one that was on its way was taken for the first frame's, which it collided with."""
    ours, motors = socket.socketpair()
    with ours, motors:
        got = []

        def motor():
            motors.sendall(b"ok")
            motors.recv(64)  # comes while it answers, and is lost
            while data := motors.recv(64):
                got.append(data)
                motors.sendall(b"ok")

        thread = threading.Thread(target=motor)
        thread.start()
        assert supervisor.Line(ours.fileno(), [b"goal", b"torque"], [b"ok"]).stop(supervisor.REPEAT, 1.0)
        ours.shutdown(socket.SHUT_RDWR)
        thread.join()
    assert {b"goal", b"torque"} <= set(got)


def test_a_supervised_toy_is_stopped_when_the_driver_hangs(toy):
    """It held its torque after a kill -9: the supervisor was private to the Dynamixel code."""
    device, loop = driven(toy, supervised="yes")
    assert str(device.protection) == "supervisor, 0.1 s"
    device.far.settimeout(10.0)
    assert device.far.recv(5) == b"stop\n"  # nobody has beaten for a while
    loop.cycle(10.0, 0.0)
    assert loop.fault.cause == "heldup" and device.torque == 0.0
    device.close()
    assert device.protection.kind == NONE


def test_a_long_reboot_under_torque_is_not_taken_for_a_hang(toy):
    """Only the motor told the supervisor that its torque was off: one that was being set up was stopped."""
    device, loop = driven(toy, supervised="yes", watchdog=0.2, boot="0.5")
    loop.reboot()
    loop.cycle(10.0, 0.0)
    device.far.setblocking(False)
    with pytest.raises(BlockingIOError):
        device.far.recv(5)
    assert loop.fault is None


def test_the_springs_deflection_is_a_wrench_where_no_sensor_measures_one(toy):
    _, loop = driven(toy, Spring(1500.0, place=5, sign=-1.0), {"deflection": 0.05, "ft": 60.0})
    state = loop.cycle(10.0, 0.0)
    assert state.wrench == pytest.approx((0, 0, 0, 0, 0, -1500.0 * 0.01))
    assert state.inferred and state.ft_stamp == state.stamp
    assert loop.ft_source == "stiffness of 1500 N·m/rad times measured deflection"
    assert loop.fault is None, "the drive stands at 3 rad: what counts is the spring's deflection"
    loop.cycle(66.0, 0.0)
    assert loop.fault.cause in ("deflection", "ft_torque")


def test_a_deflection_that_is_not_measured_stays_a_fault_until_it_is_again(toy):
    """The second reading without it was none: clear_fault was granted, and no limit held the spring."""
    device, loop = driven(toy, Spring(1500.0), {"deflection": math.inf, "ft": 60.0})
    device.deflection_known = False
    for _ in range(3):
        loop.cycle(10.0, 0.0)
    with pytest.raises(DeviceError, match="deflection is not measured any more is still there"):
        loop.clear()
    assert loop.fault is not None and device.torque == 0.0
    device.deflection_known = True
    assert loop.clear() and loop.cycle(10.0, 0.0).inferred and loop.fault is None


WRONG = {
    "no such device": ("", "parameter device = 'toys', expected one of simulated, toy"),
    "no DEVICE": ("DEVICE = 3", r"RSEA_DEVICES: .*mine\.py: no DEVICE in it"),
    "broken": ("1 / 0", r"RSEA_DEVICES: .*mine\.py: ZeroDivisionError"),
    "the package's name": (
        "from rsea_ros.hardware.outside import DeviceKind\nDEVICE = DeviceKind('simulated', print)",
        "device 'simulated' twice, expected once",
    ),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_file_that_does_not_fit_is_refused(monkeypatch, tmp_path, name):
    code, told = WRONG[name]
    (tmp_path / "mine.py").write_text(code or TOY.read_text())
    monkeypatch.setenv("RSEA_DEVICES", str(tmp_path))
    with pytest.raises(ParameterError, match=told):
        outside_device("toys", ("simulated",))


def test_options_are_texts_by_name():
    assert options_of("a=1, b = x y") == {"a": "1", "b": "x y"} and options_of("") == {}
    with pytest.raises(ParameterError, match="expected NAME=VALUE"):
        options_of("a")


def may_hurry():
    """Return whether a process of this user may run at real-time priority."""
    code = "import os; os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(99))"
    return subprocess.run([sys.executable, "-c", code], capture_output=True, check=False).returncode == 0


def begin(*words):
    """Start one; return the process, and the driver's end of its stdin."""
    near, far = socket.socketpair()
    with far:
        words = [sys.executable, "-I", "-S", supervisor.__file__, *words]
        return subprocess.Popen(words, stdin=far), near


@pytest.mark.parametrize("listens", [False, True])
def test_it_runs_before_all_other_processes_where_it_may(listens, tmp_path):
    process, driver = begin(*(["--listen", str(tmp_path / "socket")] if listens else []))
    wanted = os.SCHED_FIFO if may_hurry() else os.SCHED_OTHER
    until(lambda: os.sched_getscheduler(process.pid) == wanted)
    assert process.poll() is None
    process.kill()
    process.wait()
    driver.close()


FRAMES, REPLY = (b"zero", b"off!"), b"done"


@pytest.mark.parametrize("ignored", [0, 50])
def test_it_repeats_its_frames_until_the_motor_has_acknowledged_them(ignored):
    """It sent them 20 times, whatever the motor answered, and nobody knew whether one had arrived."""
    motor, port = socket.socketpair()
    process, driver = begin()
    order = {"timeout": 0.1, "frames": [frame.hex() for frame in FRAMES], "replies": [REPLY.hex()]}
    socket.send_fds(driver, [json.dumps(order).encode()], [port.fileno()])
    assert driver.recv(6) == b"ready\n"
    driver.send(b"a")
    assert driver.recv(1) == b"e", "it echoes"
    driver.close()  # it is dead
    port.close()
    heard = []
    while frame := motor.recv(4):
        heard.append(frame)
        if len(heard) > ignored:
            with suppress(BrokenPipeError):  # it has read an earlier reply and ended
                motor.send(b"noise" + REPLY)
    assert process.wait(10.0) == 0
    motor.close()
    assert set(heard) == set(FRAMES) and len(heard) > ignored, "and then it has ended, without a signal"


def test_a_driver_that_died_before_it_was_ready_has_a_supervisor_all_the_same():
    """It ended at a broken pipe, and the torque stayed on."""
    motor, port = socket.socketpair()
    driver, far = socket.socketpair()
    order = {"timeout": 0.1, "frames": [b"zero".hex()]}
    socket.send_fds(driver, [json.dumps(order).encode()], [port.fileno()])
    driver.close()
    supervisor.serve(far)
    port.close()
    assert motor.recv(4) == b"zero"
    motor.close()


def test_a_child_that_does_not_watch_yet_is_waited_for(monkeypatch, tmp_path):
    """After `clear_fault` a driver had torque 40 ms before its new supervisor had begun."""
    monkeypatch.setattr(protection, "START", 0.2)
    monkeypatch.setattr(protection, "SCRIPT", tmp_path / "slow.py")
    (tmp_path / "slow.py").write_text("import time\ntime.sleep(60.0)\n")
    motor, port = socket.socketpair()
    with pytest.raises(protection.SupervisorLost, match="supervisor process: timed out, expected"):
        protection.Supervisor(port.fileno(), 0.1, [b"zero"])
    motor.close()
    port.close()


@pytest.fixture
def calls(monkeypatch):
    """Return what was called: urgency, ignored signals, and whom it served."""
    made = []
    monkeypatch.setattr(supervisor, "hurry", lambda: made.append("hurry"))
    monkeypatch.setattr(supervisor.signal, "signal", lambda number, how: made.append((number, how)))
    monkeypatch.setattr(supervisor, "listen", lambda path: made.append(("listen", path)))
    monkeypatch.setattr(supervisor, "serve", lambda connection: made.append(("serve", connection)))
    monkeypatch.setattr(supervisor.socket, "socket", lambda **options: options)
    return made


GARBAGE = (b"x" * 5000, b"[" * 5000, b"\xff", b"[]", b'{"timeout": NaN}', b'{"timeout": 1, "frames": ["zz"]}')


def test_a_service_guards_on_whatever_strangers_do(tmp_path):
    """It ended with the descriptors that 60 of them took; each that was no driver left a traceback."""
    path, log = str(tmp_path / "socket"), tmp_path / "log"
    words = shlex.join([sys.executable, supervisor.__file__, "--listen", path])
    script = f"ulimit -n 40; exec {words} 2> {shlex.quote(str(log))}"
    service = subprocess.Popen(["bash", "-c", script])
    assert until(lambda: os.path.exists(path))

    def connect(words=b"", *descriptors):
        place = kept.enter_context(socket.socket(socket.AF_UNIX))
        place.settimeout(5.0)
        place.connect(path)
        if words:
            socket.send_fds(place, [words], descriptors)
        return place

    with service, ExitStack() as kept:
        kept.callback(service.kill)
        motor, port = map(kept.enter_context, socket.socketpair())
        order = json.dumps({"timeout": 60.0, "frames": [b"zero".hex()]}).encode()
        driver = connect(order, port.fileno())
        assert driver.recv(6) == b"ready\n"
        strangers = [connect() for _ in range(60)]
        assert {stranger.recv(1) for stranger in strangers} == {b""}
        for words in GARBAGE:
            assert connect(words, port.fileno()).recv(1) == b"", words
        connect().close()
        assert connect(order, port.fileno()).recv(6) == b"ready\n"
        driver.close()
        assert motor.recv(4) == b"zero" and service.poll() is None
    told = log.read_text().splitlines()
    assert sum("a connection is refused: there are 15" in line for line in told) == 46
    assert sum("bytes that are no driver's order" in line for line in told) == len(GARBAGE)
    assert len(told) == 46 + len(GARBAGE)


def test_a_service_listens_at_its_path_and_outlives_the_terminal(calls, monkeypatch):
    monkeypatch.setattr(sys, "argv", ["supervisor", "--listen", "/run/rsea", "more"])
    supervisor.main()
    assert calls == ["hurry", (signal.SIGHUP, signal.SIG_IGN), ("listen", "/run/rsea")]


def test_one_driver_is_served_whatever_the_terminal_says(calls, monkeypatch):
    monkeypatch.setattr(sys, "argv", ["supervisor"])
    supervisor.main()
    deaf = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT)
    assert calls == ["hurry", *((number, signal.SIG_IGN) for number in deaf), ("serve", {"fileno": 0})]


ROOT = Path(__file__).resolve().parents[2]
SERVICES = ROOT / "launch" / "services"
SOCKET = "/run/rsea/supervisor"


def units():
    """Return the command of each service as words: of the unit files, then of the containers."""
    commands = {}
    for path in sorted(SERVICES.glob("*.service")):
        parser = configparser.ConfigParser(interpolation=None)
        parser.read(path)
        commands[path.name] = parser["Service"]["ExecStart"].split()
    for name, service in compose()["services"].items():
        commands[f"compose {name}"] = service["command"]
    return commands


def compose():
    """Return the containers."""
    return yaml.safe_load((SERVICES / "compose.yaml").read_text())


@pytest.mark.parametrize("name", units())
def test_a_service_runs_a_file_of_the_repository_at_one_socket(name):
    words = units()[name]
    files = [word.replace("/opt/rsea/", "") for word in words if word.endswith(".py")]
    modules = [f"{words[words.index('-m') + 1].replace('.', '/')}.py"] if "-m" in words else []
    assert files + modules and all((ROOT / file).is_file() for file in files + modules)
    assert any(SOCKET in word for word in words)


@pytest.mark.parametrize("name", [name for name in units() if "driver" in name])
def test_a_driver_gets_parameters_that_it_has(name):
    given = {word.partition(":=")[0] for word in units()[name] if ":=" in word}
    assert {"device", "supervisor"} <= given <= {parameter.name for parameter in TABLE}


def test_the_containers_share_nothing_but_the_socket_and_end_in_turn():
    supervisor, driver = (compose()["services"][name] for name in ("supervisor", "driver"))
    assert supervisor["volumes"] == driver["volumes"] == ["rsea:/run/rsea"]
    assert driver["depends_on"] == ["supervisor"] and supervisor["restart"] == "always"
    assert "devices" not in supervisor, "the port comes over the socket"
