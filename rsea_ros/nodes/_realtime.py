"""Threads that keep time: exact timers, and real-time priority where the system permits it."""

from __future__ import annotations

import ctypes
import gc
import os
import sys
import threading

from rsea_ros.errors import ParameterError

SET_TIMER_SLACK = 29
"""Of Linux' prctl."""
SWITCH_INTERVAL = 1e-5
"""s after which a thread of Python must let another one in."""
HIGHEST = os.sched_get_priority_max(os.SCHED_FIFO)


def let_in_at_once() -> None:
    """Make threads that keep time wait little for those that do not, nor for a look at all objects.

    Python's own interval of 5 ms is longer than a cycle, and so is a collection of garbage in what a node has
    loaded until now.
    """
    sys.setswitchinterval(SWITCH_INTERVAL)
    gc.collect()
    gc.freeze()


def raise_priority(first: threading.Thread, priority: int) -> None:
    """Let a thread run at SCHED_FIFO `priority`, and every other thread of Python's one below it.

    They share one interpreter lock: one that holds it and does not get the processor holds up all. Children
    begin without. Raises ParameterError where the system does not permit it.
    """
    for thread in threading.enumerate():
        own = priority if thread is first else max(1, priority - 1)
        try:
            _schedule(thread, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, own)
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
    """Let all threads of Python's run as any others again."""
    for thread in threading.enumerate():
        _schedule(thread, os.SCHED_OTHER, 0)


def _schedule(thread: threading.Thread, policy: int, priority: int) -> None:
    if thread.native_id is not None:
        os.sched_setscheduler(thread.native_id, policy, os.sched_param(priority))
