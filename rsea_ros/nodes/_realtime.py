"""Threads that keep time: exact timers, a processor of their own, and real-time priority where permitted."""

import ctypes
import gc
import os
import sys
import threading
from collections.abc import Mapping, Set
from contextlib import suppress
from typing import Any

from rclpy.node import Node

from rsea_ros.errors import ParameterError
from rsea_ros.nodes._parameters import NodeParameter

SET_TIMER_SLACK = 29
"""Of Linux' prctl."""
SWITCH_INTERVAL = 1e-5
"""s after which a thread of Python must let another one in."""
PROCESSORS = os.sched_getaffinity(0)
"""That this process may run on."""
REALTIME = (
    NodeParameter(
        "realtime_priority", 0, "of the thread that keeps time, SCHED_FIFO; 0: as any process", "", 0,
        os.sched_get_priority_max(os.SCHED_FIFO), whole=True,
    ),
    NodeParameter(
        "cpu_affinity", -1, "processor that all threads of the node run on; -1: any", "", -1,
        max(PROCESSORS), whole=True,
    ),
)  # fmt: skip
"""Of every node that has to answer in time."""


class Worker:
    """A thread with exact timers that does `run` of its kind until `stop`. error: what ended it before."""

    def __init__(self) -> None:
        self.stopping = threading.Event()
        self.thread = threading.Thread(target=self._keep_error, daemon=True)
        self.error: Exception | None = None

    def start(self) -> None:
        """Begin."""
        self.thread.start()

    def stop(self) -> None:
        """End after the work that is done now."""
        self.stopping.set()
        if self.thread.is_alive() and threading.current_thread() is not self.thread:
            self.thread.join()

    def is_running(self) -> bool:
        """Return whether it still runs. Raises the error of its work."""
        if self.error is not None:
            raise self.error
        return self.thread.is_alive()

    def run(self) -> None:
        """Work until `stopping` is set."""
        raise NotImplementedError

    def _keep_error(self) -> None:
        exact_timers()
        try:
            self.run()
        except Exception as error:  # handed to the main thread by `is_running`
            self.error = error


def keep_time(node: Node, worker: Worker, values: Mapping[str, Any]) -> None:
    """Start a worker with a timed thread, as the parameters REALTIME of its node say."""
    sys.setswitchinterval(SWITCH_INTERVAL)  # Python's own, 5 ms, is longer than a cycle, and so is
    gc.collect()  # a garbage collection over everything that a node has loaded
    gc.freeze()
    ctypes.CDLL(None).malloc_trim(0)  # what imports and designs have left
    worker.start()
    processor = values["cpu_affinity"]
    if processor in PROCESSORS:
        _bind({processor})
    elif processor >= 0:
        allowed = ", ".join(map(str, sorted(PROCESSORS)))
        node.get_logger().warning(
            f"parameter cpu_affinity = {processor}, expected one of {allowed}; runs on any"
        )
    if priority := values["realtime_priority"]:
        try:
            raise_priority(worker.thread, priority)
        except ParameterError as error:
            node.get_logger().warning(f"{error}; runs without")


def raise_priority(first: threading.Thread, priority: int) -> None:
    """Let a thread run at SCHED_FIFO `priority`, and every other thread of this process one below it.

    They share the locks of the interpreter and of the middleware, through which messages arrive:
    one that holds a lock without the processor delays all. Children begin at normal priority. Raises
    ParameterError where the system does not permit it.
    """
    for thread in _threads():
        level = priority if thread == first.native_id else max(1, priority - 1)
        try:
            _schedule(thread, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, level)
        except PermissionError as error:
            raise ParameterError(
                f"parameter realtime_priority = {priority}: {error.strerror}, expected a user who may"
                " (rtprio in /etc/security/limits.d, docs/hardware.md)"
            ) from None


def exact_timers() -> None:
    """Let the timers of the calling thread end when they are due: Linux adds up to 50 us, also to the wait
    for Python's interpreter lock."""
    ctypes.CDLL(None).prctl(SET_TIMER_SLACK, 1, 0, 0, 0)


def stop_keeping_time(values: Mapping[str, Any]) -> None:
    """Undo what the parameters REALTIME have set, for all threads; what others have set stays."""
    if values["cpu_affinity"] >= 0:
        _bind(PROCESSORS)
    if values["realtime_priority"]:
        for thread in _threads():
            _schedule(thread, os.SCHED_OTHER, 0)


def _bind(processors: Set[int]) -> None:
    """Let all threads of this process run on these processors only; those that they start do likewise."""
    for thread in _threads():
        with suppress(ProcessLookupError):  # it has ended meanwhile
            os.sched_setaffinity(thread, processors)


def _threads() -> list[int]:
    return [int(name) for name in os.listdir("/proc/self/task")]


def _schedule(thread: int, policy: int, priority: int) -> None:
    with suppress(ProcessLookupError):  # it has ended meanwhile
        os.sched_setscheduler(thread, policy, os.sched_param(priority))
