"""The interface of executors: tasks run in this process, on workers, or on a Dask cluster."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Protocol


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

    def next(self, timeout: float | None) -> Done | None:
        """Wait for a job that is done; None after a timeout (s)."""


class Serial:
    """Runs jobs in this process, when their results are requested."""

    places = 1

    def __init__(self) -> None:
        self._jobs: deque[Job] = deque()

    def submit(self, job: Job) -> None:
        """Take a job."""
        self._jobs.append(job)

    def next(self, timeout: float | None) -> Done | None:
        """Run the oldest job."""
        job = self._jobs.popleft()
        try:
            return Done(job, job.function(job.argument))
        except Exception as error:
            return Done(job, error=error)


@contextmanager
def serial() -> Iterator[Serial]:
    """Give an executor without workers."""
    yield Serial()
