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
SWITCH_INTERVAL = 5e-5
"""s after which a thread of Python must let another one in: each that waits looks for it as often (373)."""
PROCESSORS = os.sched_getaffinity(0)
"""That this process may run on."""
_timed: dict[int, int] = {}
"""Priority of each thread that keeps time, by its number; none where none has one."""
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
    one that holds a lock without the processor delays all, and those that wait for the interpreter's look for
    it every SWITCH_INTERVAL: two of them took 163 % of a core, and with it the processor of the one that they
    waited for. Children begin at normal priority, threads too until `raise_new_threads`.
    Raises ParameterError where the system does not permit it.
    """
    assert first.native_id is not None
    _timed[first.native_id] = priority
    try:
        raise_new_threads()
    except PermissionError as error:
        _timed.clear()
        raise ParameterError(
            f"parameter realtime_priority = {priority}: {error.strerror}, expected a user who may"
            " (rtprio in /etc/security/limits.d, docs/hardware.md)"
        ) from None


def raise_new_threads() -> None:
    """Give threads that have begun since then their priority, while one of this process keeps time at one."""
    for thread in _threads() if _timed else ():
        level = _timed.get(thread, max(1, max(_timed.values()) - 1))
        with suppress(ProcessLookupError):  # it has ended meanwhile
            if os.sched_getparam(thread).sched_priority != level:
                _schedule(thread, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, level)


def exact_timers() -> None:
    """Let the timers of the calling thread end when they are due: Linux adds up to 50 us, also to the wait
    for Python's interpreter lock."""
    ctypes.CDLL(None).prctl(SET_TIMER_SLACK, 1, 0, 0, 0)


def stop_keeping_time(values: Mapping[str, Any]) -> None:
    """Undo what the parameters REALTIME have set, for all threads; what others have set stays."""
    if values["cpu_affinity"] >= 0:
        _bind(PROCESSORS)
    if values["realtime_priority"]:
        _timed.clear()
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
