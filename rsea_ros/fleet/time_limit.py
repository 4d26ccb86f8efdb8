"""A limit to the time of a task: a recording that takes for ever must not hold a worker for ever.

The exception is raised inside the task, between two steps of Python, so its temporary files go and its worker
stays. A call that never returns to Python (a file system that hangs) ends its worker a while later.
"""

from __future__ import annotations

import ctypes
import math
import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager

TIME_LIMIT = 3600.0
"""s of a task. A diagnosis of a minute at 280 Hz takes about one minute, one of ten minutes about ten."""
GRACE = 60.0
"""s after the exception, until a worker ends itself: reading 1 GB from a slow disk takes about ten."""
_STATUS = 70
"""Of a worker that ends itself: EX_SOFTWARE of sysexits."""


class OutOfTime(BaseException):
    """A task took longer than it may. No `except Exception` on the way out catches it."""


@contextmanager
def limit_time(seconds: float) -> Iterator[None]:
    """Raise OutOfTime in the block after some seconds; infinity is no limit."""
    over, thread = threading.Event(), threading.get_ident()
    on_worker = threading.current_thread() is not threading.main_thread()
    if math.isfinite(seconds):
        threading.Thread(target=_watch, args=(over, thread, seconds, on_worker), daemon=True).start()
    try:
        try:
            yield
        finally:
            over.set()
    finally:  # the exception may arrive inside the inner one
        over.set()
        _raise_in(thread, None)


def _watch(over: threading.Event, thread: int, seconds: float, on_worker: bool) -> None:
    if over.wait(seconds):
        return
    _raise_in(thread, OutOfTime)
    if not over.wait(GRACE) and on_worker:
        os._exit(_STATUS)


def _raise_in(thread: int, error: type[BaseException] | None) -> None:
    """Raise an error in a thread at its next step of Python; with None, forget one that is still to come."""
    raised = ctypes.py_object(error) if error is not None else None
    ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(thread), raised)
