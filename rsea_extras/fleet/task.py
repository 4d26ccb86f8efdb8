"""One task, within its time limit.

It needs only the recording: rig and topics are included, row and artefacts are returned.

The exception is raised inside the task, between two steps of Python, so its temporary files go and its worker
stays. A call that never returns to Python (a file system that hangs) ends its worker a while later.
"""

import ctypes
import math
import os
import resource
import threading
import time
import traceback
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from rsea_extras.fleet.joints import MappedJoint
from rsea_extras.fleet.sources import Bag, fingerprint, local_copy, relist
from rsea_extras.fleet.store import Row, Store, TaskOutcome, empty, key_of
from rsea_ros import RseaError
from rsea_ros.extension.base import brief, version

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
    over, thread, end = threading.Event(), threading.get_ident(), time.monotonic() + seconds
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
        if time.monotonic() >= end:  # CPython 3.11 beside a debugger or profiler never returns from this call
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


_LONGEST = 500
"""Characters of a reason."""


class Changed(Exception):
    """A recording that another program wrote to while it was read: it is left for the next run."""


@dataclass(frozen=True)
class Task:
    """A recording of one joint. recording: the hash of its content. model_version: of this software.

    time_limit: s that it may take. page: whether a diagnosis leaves its page, too.
    """

    bag: Bag
    joint: MappedJoint
    recording: str
    model_version: str
    time_limit: float = math.inf
    page: bool = False

    @property
    def key(self) -> str:
        return key_of(self.joint.name, self.recording, self.model_version, self.joint.settings)

    def row(self, **stated: object) -> Row:
        """Return the row with the stated values and the identity of the task only."""
        return empty(
            self.joint.name,
            recording=self.recording,
            bag=self.bag.url,
            bytes=self.bag.size,
            stamp=self.bag.stamp,
            model_version=self.model_version,
            settings=self.joint.settings,
            **stated,
        )


def read_fingerprint(bag: Bag) -> tuple[Bag, str]:
    """Return a recording with its present listing, and the hash of its content.

    Raises Changed where it changed meanwhile, FleetError where it cannot be read.
    """
    before = relist(bag)
    digest = fingerprint(before)
    if relist(bag) != before:
        raise Changed(bag.url)
    return before, digest


def work(task: Task) -> TaskOutcome:
    """Read, check, identify and, on request, diagnose; return row and artefacts.

    An error in the recording becomes the row's outcome and reason. Raises Changed as read_fingerprint.
    """
    from rsea_extras.fleet.analysis import analyse  # a second of numerics that the client never needs
    from rsea_ros.extension.recording import on_cores

    row, files = task.row(), {}
    begin = time.perf_counter()
    _forget_peak()
    with on_cores(1):
        try:
            with limit_time(task.time_limit), local_copy(task.bag) as path:
                files = analyse(row, path, task.bag.url, task.joint, page=task.page)
            row["outcome"] = "done"
        except RseaError as error:
            row |= {"outcome": "refused", "reason": reason(str(error))}
        except OutOfTime:
            slow = f"took more than {task.time_limit / 60.0:g} min: a larger --time-limit, then --again"
            row |= {"outcome": "quarantined", "reason": slow}
        except Exception as error:
            row |= {"outcome": "quarantined", "reason": reason(_fault(error))}
    present = None
    with suppress(RseaError):
        present = relist(task.bag)
    if present != task.bag:
        raise Changed(task.bag.url)
    return TaskOutcome(row | {"seconds": time.perf_counter() - begin, "peak_memory": _peak()}, files)


def reason(text: str) -> str:
    return brief(" ".join(text.split()), _LONGEST)


def _fault(error: Exception) -> str:
    place = traceback.extract_tb(error.__traceback__)[-1]
    kind = type(error).__name__
    return f"a bug in rsea, please report it: {kind} in {Path(place.filename).name}:{place.lineno}: {error}"


def _forget_peak() -> None:
    """Reset the system's count of this process's peak memory, where possible."""
    with suppress(OSError):
        switch = os.open("/proc/self/clear_refs", os.O_WRONLY)
        try:
            os.write(switch, b"5")
        finally:
            os.close(switch)


def _peak() -> int:
    """Return the peak of this process's memory, bytes, since _forget_peak if the system provides it."""
    with suppress(OSError):
        lines = Path("/proc/self/status").read_text(encoding="ascii", errors="replace").splitlines()
        return next(1024 * int(line.split()[1]) for line in lines if line.startswith("VmHWM"))
    return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


Held = tuple[Bag, tuple[MappedJoint, ...]]


def are_new(store: Store, held: Sequence[Held]) -> Iterator[bool]:
    """Yield for each joint of each recording whether it has no row, by paths, bytes and stamps."""
    keys, recordings = store.known_rows()
    for bag, joints in held:
        recording = recordings.get((bag.url, bag.size, bag.stamp))
        for joint in joints:
            yield recording is None or Task(bag, joint, recording, version()).key not in keys
