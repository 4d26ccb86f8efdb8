"""Priorities of threads, in a process of its own so that the tests keep theirs."""

import subprocess
import sys
from pathlib import Path

from bench.bare_loop import permitted

ROOT = Path(__file__).resolve().parents[2]
PROGRAM = """
import os, subprocess, sys, threading
from rsea_ros.errors import ParameterError
from rsea_ros.nodes._realtime import raise_priority, usual_priority

def priorities():
    own = [os.sched_getparam(thread).sched_priority for thread in (first.native_id, 0)]
    ask = "import os; print(os.sched_getparam(0).sched_priority)"
    return *own, int(subprocess.check_output([sys.executable, "-c", ask]))

stop = threading.Event()
first = threading.Thread(target=stop.wait)
first.start()
try:
    raise_priority(first, 20)
    raised = priorities()
    usual_priority()
    print(*raised, *priorities())
except ParameterError as error:
    print(error)
stop.set()
"""


def test_one_thread_gets_the_priority_the_others_one_below_and_children_none():
    command = [sys.executable, "-c", PROGRAM]
    said = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    expected = "20 19 0 0 0 0" if permitted(20) else "parameter realtime_priority = 20: "
    assert said.stdout.startswith(expected), said.stderr
