"""The supervisor of a motor: a process of its own that the machine's other work must not hold up."""

import json
import os
import socket
import subprocess
import sys
from contextlib import suppress

import pytest

from rsea_ros.hardware import supervisor
from test.nodes.stalls import until


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
