"""Where tasks run: the interface, this process, and worker processes of this machine.

Workers are reached through a pair of sockets that only parent and child hold. No port is opened: those of a
scheduler that listened on 127.0.0.1 ran what any local user sent (decision 0192). A worker that ends or takes
too much memory is replaced, and its job comes back as lost.
"""

from __future__ import annotations

import gc
import multiprocessing
import os
import pickle
import signal
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any, Protocol

from rsea_ros.extension.base import STOPPING, deaf_to_interrupts


class WorkerLost(Exception):
    """The process that ran a task has ended: it was killed, or took more memory than it may."""


@dataclass(frozen=True)
class Job:
    """A function and its arguments; `attempt` counts from 0."""

    function: Callable[[Any], Any]
    argument: Any
    attempt: int = 0


@dataclass(frozen=True)
class Done:
    """The outcome of a job: a value, or an error."""

    job: Job
    value: Any = None
    error: BaseException | None = None


class Executor(Protocol):
    """Runs jobs. places: how many may be in flight at once."""

    @property
    def places(self) -> int:
        """How many jobs may be in flight at once."""

    def submit(self, job: Job) -> None:
        """Take a job."""

    def next(self, timeout: float) -> Done | None:
        """Wait for a job that is done; None after a timeout (s)."""


class Serial:
    """Runs jobs in this process, when their results are requested."""

    places = 1

    def __init__(self) -> None:
        self._jobs: deque[Job] = deque()

    def submit(self, job: Job) -> None:
        self._jobs.append(job)

    def next(self, timeout: float) -> Done | None:
        job = self._jobs.popleft()
        try:
            return Done(job, job.function(job.argument))
        except Exception as error:
            return Done(job, error=error)


PER_WORKER = 2
"""Jobs in flight for each worker: one that runs, and one that waits here."""
LOOKED_AT_EVERY = 0.2
"""s between two looks at the memory of the workers."""
SHARE = 0.95
"""Of the memory of a worker, at which it is ended."""
_PAGE = os.sysconf("SC_PAGE_SIZE")


class Worker:
    """A process that runs one job at a time. job: the one that it has."""

    def __init__(self) -> None:
        context = multiprocessing.get_context("spawn")
        self.pipe, theirs = context.Pipe()
        self.process = context.Process(target=serve, args=(theirs,), daemon=True)
        self.job: Job | None = None
        with deaf_to_interrupts():
            self.process.start()
        theirs.close()

    @property
    def memory(self) -> int:
        """Bytes that it has in memory; 0 once it has ended."""
        with suppress(OSError, ValueError, IndexError):
            return _PAGE * int(Path(f"/proc/{self.process.pid}/statm").read_text(encoding="ascii").split()[1])
        return 0

    def end(self) -> None:
        self.process.kill()
        self.process.join()
        self.pipe.close()


class Pool:
    """An executor on some workers. memory: bytes that each may have."""

    def __init__(self, workers: int, memory: int) -> None:
        self._memory, self._looked_at = memory, 0.0
        self._ready: deque[Job] = deque()
        self._workers = [Worker() for _ in range(workers)]

    @property
    def places(self) -> int:
        return PER_WORKER * len(self._workers)

    def submit(self, job: Job) -> None:
        self._ready.append(job)
        self._hand_out()

    def next(self, timeout: float) -> Done | None:
        """Wait for a job that is done, or whose worker has ended; None after a timeout (s)."""
        until = time.monotonic() + timeout
        while True:
            self._end_greedy()
            left = until - time.monotonic()
            busy = {worker.pipe: worker for worker in self._workers if worker.job is not None}
            for pipe in wait(list(busy), max(0.0, min(LOOKED_AT_EVERY, left))):
                done = self._take(busy[pipe])  # type: ignore[index]
                self._hand_out()
                return done
            if time.monotonic() >= until:
                return None

    def close(self) -> None:
        """End all workers at once: only the client writes, so they leave nothing half-written."""
        for worker in self._workers:
            worker.end()

    def _take(self, worker: Worker) -> Done:
        """Return what a worker sent; a lost one is replaced."""
        job, worker.job = worker.job, None
        assert job is not None
        try:
            answer = worker.pipe.recv_bytes()
        except (EOFError, OSError):
            worker.process.join(1.0)
            lost = WorkerLost(f"status {worker.process.exitcode}")
            worker.end()
            self._workers[self._workers.index(worker)] = Worker()
            return Done(job, error=lost)
        try:
            return Done(job, *pickle.loads(answer))
        except Exception as error:  # whatever an exception's own constructor raises
            return Done(job, error=error)

    def _hand_out(self) -> None:
        for worker in self._workers:
            if worker.job is None and self._ready:
                worker.job = self._ready.popleft()
                with suppress(OSError):  # it has ended: next() finds its pipe closed
                    worker.pipe.send_bytes(pickle.dumps((worker.job.function, worker.job.argument)))

    def _end_greedy(self) -> None:
        """End each worker that has more memory than it may."""
        if time.monotonic() - self._looked_at < LOOKED_AT_EVERY:
            return
        self._looked_at = time.monotonic()
        for worker in self._workers:
            if worker.memory > SHARE * self._memory:
                worker.process.kill()


@contextmanager
def on_this_machine(workers: int, memory: int) -> Iterator[Pool]:
    """Give an executor on worker processes. memory: bytes that each may have."""
    pool = Pool(workers, memory)
    try:
        with frequent_collection():
            yield pool
    finally:
        pool.close()


def serve(pipe: Connection[Any, Any]) -> None:
    """Run what the client sends until it ends. Ctrl-C is left to the client, which ends the workers.

    Jobs run beside the main thread, as limit_time expects of a worker.
    """
    for number in STOPPING:
        signal.signal(number, signal.SIG_IGN if number == signal.SIGINT else signal.SIG_DFL)
    thread = threading.Thread(target=_run_jobs, args=(pipe,))
    thread.start()
    thread.join()


def _run_jobs(pipe: Connection[Any, Any]) -> None:
    with suppress(EOFError, OSError):  # the client has ended
        while True:
            request = pipe.recv_bytes()
            try:
                function, argument = pickle.loads(request)
                answer = pickle.dumps((function(argument), None))
            except Exception as error:
                answer = _packed(error)
            pipe.send_bytes(answer)


def _packed(error: Exception) -> bytes:
    """Return an error for the client, or, where it cannot be sent, one with its text."""
    with suppress(Exception):
        return pickle.dumps((None, error))
    return pickle.dumps((None, RuntimeError(f"{type(error).__name__}: {error}")))


@contextmanager
def frequent_collection() -> Iterator[None]:
    """Let Python collect cyclic garbage as often as new objects require.

    It waits until they are a quarter of all: with the 300 000 objects of the modules, garbage of thousands of
    tasks piles up, and looks like a leak. Those objects are left out here.
    """
    gc.collect()
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()


def memory_for(workers: int) -> int:
    """Return the memory (bytes) of each worker: this machine's, or that of its control group, divided."""
    total = os.sysconf("SC_PHYS_PAGES") * _PAGE
    with suppress(OSError, ValueError):
        total = min(total, int(Path("/sys/fs/cgroup/memory.max").read_text(encoding="ascii")))
    return int(0.9 * total / workers)
