"""Nodes as processes: they start, keep their priorities and end."""

import os
import runpy
import signal
import subprocess
import sys
import warnings
from contextlib import suppress
from pathlib import Path

import pytest
import rclpy
from rclpy.executors import SingleThreadedExecutor
from std_msgs.msg import Empty

from bench.processes import may_have
from rsea_ros import processes
from rsea_ros.nodes._waiter import Pulse, anything_to_do
from rsea_ros.nodes.joint import KINDS
from test.nodes.conftest import Process


@pytest.mark.parametrize(("name", "module"), KINDS.items())
def test_a_node_is_a_program(name, module, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", [name, "--help"])
    with warnings.catch_warnings(), pytest.raises(SystemExit) as left:
        warnings.simplefilter("ignore", RuntimeWarning)  # it has been imported before, and runs once more
        runpy.run_module(module, run_name="__main__")
    assert left.value.code == 0
    assert capsys.readouterr().out.startswith(f"usage: ros2 run rsea_ros {name} ")


def test_a_started_program_does_not_hear_the_terminals_ctrl_c():
    begun = processes.start(["sleep", "60"])
    assert os.getsid(begun.pid) == begun.pid
    processes.stop([begun])
    assert begun.returncode == -signal.SIGTERM


@pytest.mark.parametrize("way", ["pipe", "terminal"])
def test_a_driver_whose_output_nobody_reads_answers(listener, tmp_path, way):
    """Its first log line into a full pipe, or a terminal after Ctrl-S, was its last: no stop was answered."""
    log = tmp_path / "log"
    if way == "pipe":
        os.mkfifo(log)
        ends = [os.open(log, os.O_RDWR | os.O_NONBLOCK)]
        with suppress(BlockingIOError):
            while True:
                os.write(ends[0], b"full")
    else:
        ends = os.openpty()
        log.symlink_to(os.ttyname(ends[1]))
        os.write(ends[0], b"\x13")
    process = Process("driver", log, {"device": "simulated", "autostart": True}, {"__ns": f"/{way}"})
    for service in ("stop", "clear_fault"):
        assert listener.call(f"/{way}/driver/{service}").success
    assert process.stop(signal.SIGTERM) == 0
    for end in ends:
        os.close(end)


ROOT = Path(__file__).resolve().parents[2]
STUCK = """
import sys, time
from rsea_ros.nodes._run import Component, Program

class Stuck(Program):
    def __init__(self, node, values):
        self.node = node

    def is_finished(self):
        self.node.get_logger().info("looked", once=True)
        while {stuck}:
            time.sleep(1e6)
        return False

sys.exit(Component("stuck", (), Stuck, patience={patience}).run())
"""


def test_a_node_without_unfinished_work_ends_after_its_patience():
    """model outlived SIGINT until SIGKILL, and nobody knew where."""
    programs = []
    for stuck, patience in ((True, 0.5), (False, 30.0)):
        command = [sys.executable, "-c", STUCK.format(stuck=stuck, patience=patience)]
        process = subprocess.Popen(command, cwd=ROOT, stderr=subprocess.PIPE, text=True)
        programs.append((stuck, process))
    for stuck, process in programs:
        assert "looked" in process.stderr.readline()
        process.send_signal(signal.SIGINT)
        said = process.communicate(timeout=50.0)[1]
        assert process.returncode == stuck
        assert ("in is_finished" in said) == stuck


def test_what_another_thread_has_just_destroyed_ends_no_node():
    """It was looked up, destroyed by a thread of a session, and then waited for: RCLError ended the node."""
    rclpy.init(context=(context := rclpy.Context()))
    quiet = rclpy.create_node("quiet", context=context, enable_rosout=False, start_parameter_services=False)
    executor, pulse = SingleThreadedExecutor(context=context), Pulse(context, 0.05)
    gone = quiet.create_subscription(Empty, "gone", lambda message: None, 1)
    try:
        gone.handle.destroy_when_not_in_use()
        assert gone in quiet.subscriptions
        assert not anything_to_do([quiet], executor, pulse)
    finally:
        pulse.close()
        quiet.destroy_node()
        context.shutdown()


PRIORITIES = """
import os, subprocess, sys, threading
from rsea_ros.errors import ParameterError
from rsea_ros.nodes._cycle import raise_new_threads, raise_priority, stop_keeping_time

def priorities():
    threads = first.native_id, 0, *(thread.native_id for thread in later)
    own = [os.sched_getparam(thread).sched_priority for thread in threads]
    ask = "import os; print(os.sched_getparam(0).sched_priority)"
    return *own, int(subprocess.check_output([sys.executable, "-c", ask]))

stop = threading.Event()
first = threading.Thread(target=stop.wait)
first.start()
later = []
try:
    raise_priority(first, 20)
    raised = priorities()
    for priority in (0, 15):
        later.append(threading.Thread(target=stop.wait))
        later[-1].start()
        raise_priority(later[-1], priority) if priority else raise_new_threads()
    raised += priorities()
    stop_keeping_time({"realtime_priority": 20, "cpu_affinity": -1})
    print(*raised, *priorities())
    raise_new_threads()
    assert not any(priorities())
except ParameterError as error:
    print(error)
stop.set()
"""


def test_threads_that_keep_time_get_their_priority_all_others_one_below_and_children_none():
    """One that began later lost the processor with the interpreter's lock, and two others spun for it."""
    command = [sys.executable, "-c", PRIORITIES]
    said = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    expected = "20 19 0 20 19 19 15 0 0 0 0 0 0" if may_have(20) else "parameter realtime_priority = 20: "
    assert said.stdout.startswith(expected), said.stderr


AFFINITY = """
import os, subprocess, sys, threading
from types import SimpleNamespace
from rsea_ros.nodes._cycle import PROCESSORS, keep_time, stop_keeping_time

def processors():
    threads = [os.sched_getaffinity(thread) for thread in (worker.thread.native_id, 0)]
    ask = "import os; from rsea_ros.hardware import supervisor; supervisor.hurry()"
    ask += "; print(*os.sched_getaffinity(0))"
    return *threads, {*map(int, subprocess.check_output([sys.executable, "-c", ask]).split())}

logger = SimpleNamespace(warning=print)
node = SimpleNamespace(get_logger=lambda: logger)
stop = threading.Event()
thread = threading.Thread(target=stop.wait)
worker = SimpleNamespace(thread=thread, start=thread.start)
bound = {"realtime_priority": 0, "cpu_affinity": max(PROCESSORS)}
keep_time(node, worker, bound)
assert processors() == ({max(PROCESSORS)}, {max(PROCESSORS)}, PROCESSORS), processors()
stop_keeping_time({"realtime_priority": 0, "cpu_affinity": -1})
assert processors()[0] == {max(PROCESSORS)}, "bound by others: it stays"
stop_keeping_time(bound)
assert processors() == (PROCESSORS,) * 3, processors()
worker.start = lambda: None
keep_time(node, worker, {"realtime_priority": 0, "cpu_affinity": max(PROCESSORS) + 1})
stop.set()
"""


def test_a_node_keeps_to_one_processor_and_its_supervisor_does_not():
    command = [sys.executable, "-c", AFFINITY]
    said = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    highest = max(os.sched_getaffinity(0))
    assert said.startswith(f"parameter cpu_affinity = {highest + 1}, expected one of 0")
    assert said.endswith("; runs on any\n")
