"""Threads that keep time: exact timers, and real-time priority where the system permits it."""

from __future__ import annotations

import ctypes
import gc
import os
import sys
import threading
from contextlib import suppress
from typing import Protocol

from rclpy.node import Node

from rsea_ros.errors import ParameterError
from rsea_ros.nodes._parameters import NodeParameter

SET_TIMER_SLACK = 29
"""Of Linux' prctl."""
SWITCH_INTERVAL = 1e-5
"""s after which a thread of Python must let another one in."""
REALTIME = NodeParameter(
    "realtime_priority", 0, "of the thread that keeps time, SCHED_FIFO; 0: as any process", "", 0,
    os.sched_get_priority_max(os.SCHED_FIFO), whole=True,
)  # fmt: skip
"""Of every node that has to answer in time."""


class Worker(Protocol):
    """The owner of a thread."""

    thread: threading.Thread

    def start(self) -> None:
        """Begin."""


def keep_time(node: Node, worker: Worker, priority: int) -> None:
    """Start a worker with a timed thread, at the requested priority (0: normal)."""
    _let_in_at_once()
    worker.start()
    _hurry(node, worker.thread, priority)


def _let_in_at_once() -> None:
    """Shorten the waits of timed threads for other threads and for garbage collection.

    Python's switch interval of 5 ms is longer than a cycle, and so is a garbage collection over everything
    that a node has loaded.
    """
    sys.setswitchinterval(SWITCH_INTERVAL)
    gc.collect()
    gc.freeze()


def _hurry(node: Node, first: threading.Thread, priority: int) -> None:
    """Give a timed thread the requested priority; warn where it is not permitted."""
    if priority:
        try:
            raise_priority(first, priority)
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


def usual_priority() -> None:
    """Let all threads run as any others again."""
    for thread in _threads():
        _schedule(thread, os.SCHED_OTHER, 0)


def _threads() -> list[int]:
    return [int(name) for name in os.listdir("/proc/self/task")]


def _schedule(thread: int, policy: int, priority: int) -> None:
    with suppress(ProcessLookupError):  # it has ended meanwhile
        os.sched_setscheduler(thread, policy, os.sched_param(priority))
