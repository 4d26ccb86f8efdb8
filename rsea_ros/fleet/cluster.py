"""Dask's workers: a cluster on this machine, or one that runs already.

A worker is a process with one thread. Spilling is off: a task that takes more memory than its worker may have
ends that worker, and the engine counts how often. Only `rsea fleet run` imports this module.
"""

from __future__ import annotations

import gc
import logging
import math
import os
import queue
import re
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from multiprocessing import resource_tracker
from typing import Any

import dask
import distributed
from dask.utils import key_split
from distributed.scheduler import KilledWorker
from distributed.utils import silence_logging_cmgr

from rsea_ros.fleet.executor import Done, Job, WorkerLost
from rsea_ros.fleet.fleet_error import FleetError
from rsea_ros.fleet.scheduler_extensions import embedded_extensions
from rsea_ros.processes import deaf_to_interrupts

SETTINGS: Mapping[str, Any] = {
    "distributed.nanny.pre-spawn-environ.MALLOC_TRIM_THRESHOLD_": None,
    "distributed.worker.preload": ["rsea_ros.fleet.worker"],
    "distributed.worker.profile.enabled": False,
    "distributed.worker.memory.target": False,
    "distributed.worker.memory.spill": False,
    "distributed.worker.memory.pause": False,
    "distributed.worker.memory.terminate": 0.95,
    "distributed.scheduler.worker-saturation": 1.0,
    "distributed.scheduler.allowed-failures": 0,
    "distributed.scheduler.work-stealing": False,
    "distributed.deploy.lost-worker-timeout": "5s",
    "distributed.admin.system-monitor.log-length": 600,
}
"""Tasks wait at the scheduler, so that a worker that ends takes along what it ran and hardly more. Workers
start without Dask's MALLOC_TRIM_THRESHOLD_: with it glibc maps every array of 128 kB anew, and identifying a
minute takes 0.65 s of processor time instead of 0.39 s. The log of the dashboard's load curves covers five
minutes: an hour of it, Dask's default, looks like a leak."""
PER_WORKER = 3
"""Tasks in flight for each worker: one that runs, and some that wait at the scheduler."""
NAMES = 1000
"""Jobs after which Dask's cache of their names is emptied: it keeps the last 100 000, about 0.3 kB each."""
_ADDRESS = re.compile(r"(\w+://)?(\[[0-9a-fA-F:]+\]|[^\s/:]+):\d+/?")
"""HOST:PORT with or without a protocol: Dask tries anything else for a minute."""
CONNECT = "30s"
COUNTED_EVERY = 10.0
"""s, after which the workers are counted anew: those of another cluster come and go."""


class OnDask:
    """Runs jobs on a cluster; at most PER_WORKER for each worker are in flight.

    refill: restarts workers that were killed before they were up, which nothing else restarts.
    """

    def __init__(self, client: Any, refill: Callable[[], object] = lambda: None) -> None:
        self._client, self._refill = client, refill
        self._done: queue.Queue[Any] = queue.Queue()
        self._jobs: dict[str, tuple[Job, Any]] = {}
        self._places, self._counted = 0, -math.inf
        self._named = 0

    @property
    def places(self) -> int:
        """How many jobs may be in flight at once."""
        if time.monotonic() - self._counted > COUNTED_EVERY:
            self._counted = time.monotonic()
            self._refill()
            self._places = PER_WORKER * max(1, self._client.scheduler_info(n_workers=0)["n_workers"])
        return self._places

    def submit(self, job: Job) -> None:
        """Send a job to the scheduler."""
        self._named += 1
        if self._named % NAMES == 0:
            key_split.cache_clear()
        future = self._client.submit(job.function, job.argument, pure=False)
        self._jobs[future.key] = job, future
        future.add_done_callback(self._done.put)

    def next(self, timeout: float | None) -> Done | None:
        """Wait for a job that is done. Raises FleetError where the scheduler is lost."""
        try:
            future = self._done.get(timeout=timeout)
        except queue.Empty:
            self._check()
            return None
        job, _ = self._jobs.pop(future.key)
        if future.status in ("cancelled", "lost"):
            raise self._lost_error()
        try:
            return Done(job, future.result())
        except KilledWorker as error:
            return Done(job, error=WorkerLost(str(error)))
        except Exception as error:
            self._check()
            return Done(job, error=error)
        finally:
            future.release()

    def _check(self) -> None:
        if self._client.status != "running":
            raise self._lost_error()

    def _lost_error(self) -> FleetError:
        return FleetError("the scheduler is lost: what was done is in the store, run again to go on")


@contextmanager
def on_scheduler(address: str) -> Iterator[OnDask]:
    """Give an executor on a cluster that runs already. Raises FleetError where nobody answers.

    Dask logs nothing meanwhile: a lost scheduler is one FleetError, not a traceback on the terminal.
    """
    expected = "expected the address of a Dask scheduler that runs"
    if not _ADDRESS.fullmatch(address):
        raise FleetError(f"--scheduler {address}: no address, {expected}, such as tcp://HOST:8786")
    with silence_logging_cmgr(logging.CRITICAL):
        try:
            client = distributed.Client(  # type: ignore[no-untyped-call]
                address, timeout=CONNECT, set_as_default=False
            )
        except (OSError, ValueError, TimeoutError) as error:
            raise FleetError(f"--scheduler {address}: {error}, {expected}") from None
        with client, frequent_collection():
            yield OnDask(client)


@contextmanager
def _dashboard_named(address: str) -> Iterator[None]:
    """Let the error of a cluster that cannot begin name the only address that a user states."""
    try:
        yield
    except RuntimeError as error:
        if not isinstance(error.__cause__, OSError):
            raise
        why = error.__cause__.strerror or error.__cause__
        raise FleetError(f"--dashboard {address}: {why}, expected HOST:PORT of this machine") from None


@contextmanager
def on_this_machine(workers: int, memory: int, dashboard: str) -> Iterator[tuple[OnDask, str]]:
    """Give an executor on worker processes of this machine, and the address of Dask's dashboard.

    memory: bytes that each worker may have. dashboard: host and port, port 0 for any.
    """
    resource_tracker.ensure_running()  # its start would let the threads of the block hear Ctrl-C again
    with dask.config.set(SETTINGS):
        with deaf_to_interrupts(), _dashboard_named(dashboard):
            cluster = distributed.LocalCluster(  # type: ignore[no-untyped-call]
                n_workers=workers,
                threads_per_worker=1,
                processes=True,
                memory_limit=memory,
                host="127.0.0.1",
                dashboard_address=dashboard,
                silence_logs=logging.CRITICAL,
                scheduler_kwargs={"extensions": embedded_extensions()},
            )
        client = distributed.Client(cluster, set_as_default=False)  # type: ignore[no-untyped-call]
        with cluster, client, frequent_collection():
            yield OnDask(client, partial(cluster.scale, workers)), cluster.dashboard_link


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


def cores() -> int:
    """Return how many cores this process may use."""
    return len(os.sched_getaffinity(0))


def memory_for(workers: int) -> int:
    """Return the memory (bytes) of each worker: Dask's value for this machine, divided."""
    return int(0.9 * distributed.system.MEMORY_LIMIT / workers)
