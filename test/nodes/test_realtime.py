"""Priorities and processors of threads, in a process of its own so that the tests keep theirs."""

import os
import subprocess
import sys
from pathlib import Path

from bench.processes import may_have

ROOT = Path(__file__).resolve().parents[2]
PROGRAM = """
import os, subprocess, sys, threading
from rsea_ros.errors import ParameterError
from rsea_ros.nodes._realtime import raise_new_threads, raise_priority, stop_keeping_time

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
    command = [sys.executable, "-c", PROGRAM]
    said = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    expected = "20 19 0 20 19 19 15 0 0 0 0 0 0" if may_have(20) else "parameter realtime_priority = 20: "
    assert said.stdout.startswith(expected), said.stderr


AFFINITY = """
import os, subprocess, sys, threading
from types import SimpleNamespace
from rsea_ros.nodes._realtime import PROCESSORS, keep_time, stop_keeping_time

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
