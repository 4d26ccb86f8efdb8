"""Workers of a Dask cluster that runs already and whose address the user gives (`--scheduler`).

Whoever reaches its scheduler runs code on its workers (SECURITY.md). Only `rsea fleet run` imports this.
"""

import logging
import math
import queue
import re
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import distributed
from dask.utils import key_split
from distributed.scheduler import KilledWorker
from distributed.utils import silence_logging_cmgr

from rsea_extras.fleet import FleetError
from rsea_extras.fleet.pool import Done, Job, WorkerLost, frequent_collection

PER_WORKER = 3
"""Tasks in flight for each worker: one that runs, and some that wait at the scheduler."""
NAMES = 1000
"""Jobs after which Dask's cache of their names is emptied: it keeps the last 100 000, about 0.3 kB each."""
_ADDRESS = re.compile(r"(\w+://)?(\[[0-9a-fA-F:]+\]|[^\s/:]+):\d+/?")
"""HOST:PORT with or without a protocol: Dask tries anything else for a minute."""
CONNECT = "30s"
_LOST = "the scheduler is lost: what was done is in the store, run again to go on"
COUNTED_EVERY = 10.0
"""s, after which the workers are counted anew: those of another cluster come and go."""


class OnDask:
    """Runs jobs on a cluster; at most PER_WORKER for each worker are in flight."""

    def __init__(self, client: Any) -> None:
        self._client = client
        self._done: queue.Queue[Any] = queue.Queue()
        self._jobs: dict[str, tuple[Job, Any]] = {}
        self._places, self._counted = 0, -math.inf
        self._named = 0

    @property
    def places(self) -> int:
        if time.monotonic() - self._counted > COUNTED_EVERY:
            self._counted = time.monotonic()
            self._places = PER_WORKER * max(1, self._client.scheduler_info(n_workers=0)["n_workers"])
        return self._places

    def submit(self, job: Job) -> None:
        self._named += 1
        if self._named % NAMES == 0:
            key_split.cache_clear()
        future = self._client.submit(job.function, job.argument, pure=False)
        self._jobs[future.key] = job, future
        future.add_done_callback(self._done.put)

    def next(self, timeout: float) -> Done | None:
        """Wait for a job that is done. Raises FleetError where the scheduler is lost."""
        try:
            future = self._done.get(timeout=timeout)
        except queue.Empty:
            self._check()
            return None
        job, _ = self._jobs.pop(future.key)
        if future.status in ("cancelled", "lost"):
            raise FleetError(_LOST)
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
            raise FleetError(_LOST)


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
