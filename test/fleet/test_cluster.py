"""The executor on Dask, against a client that stands in for it: what is in flight, and what is lost."""

from __future__ import annotations

import gc
import io
import logging
import os
import subprocess
import sys
from types import SimpleNamespace

import pytest
from dask.utils import key_split
from distributed.scheduler import KilledWorker

from rsea_ros.fleet import cluster
from rsea_ros.fleet.cluster import PER_WORKER, OnDask, frequent_collection, on_scheduler, on_this_machine
from rsea_ros.fleet.executor import Job, WorkerLost
from rsea_ros.fleet.fleet_error import FleetError


class Future:
    """A future that is done at the first request."""

    def __init__(self, key: str, status: str, result: object) -> None:
        self.key, self.status, self._result = key, status, result

    def add_done_callback(self, call):
        call(self)

    def result(self):
        if isinstance(self._result, Exception):
            raise self._result
        return self._result

    def release(self):
        pass


class Client:
    """Two workers; each job submitted ends as `outcome` says: the status of its future, and its result."""

    def __init__(self) -> None:
        self.status, self.outcome = "running", ("finished", 1)

    def scheduler_info(self, n_workers):
        return {"n_workers": 2}

    def submit(self, function, argument, pure):
        assert pure is False, "the same function of the same argument again is another try"
        return Future("key", *self.outcome)


def test_a_few_tasks_for_each_worker_are_in_flight():
    assert OnDask(Client()).places == 2 * PER_WORKER


def test_missing_workers_are_requested_repeatedly(monkeypatch):
    """Nothing else restarts a worker that is killed before it is up: without this a run waits for ever."""
    now, asked = [100.0], []
    monkeypatch.setattr(cluster, "time", SimpleNamespace(monotonic=lambda: now[0]))
    workers = OnDask(Client(), lambda: asked.append(now[0]))
    for now[0] in (100.0, 101.0, 111.0, 112.0):
        assert workers.places == 2 * PER_WORKER
    assert asked == [100.0, 111.0]


@pytest.mark.parametrize(
    ("result", "error"),
    [
        (KilledWorker("task", SimpleNamespace(address="tcp://x"), 0), WorkerLost),
        (ValueError("no"), ValueError),
    ],
)
def test_an_error_comes_back_with_its_job(result, error):
    client, job = Client(), Job(print, 1)
    client.outcome = "error", result
    workers = OnDask(client)
    workers.submit(job)
    done = workers.next(1.0)
    assert done is not None and done.job == job and isinstance(done.error, error)


def test_a_lost_scheduler_ends_the_run():
    client = Client()
    workers = OnDask(client)
    assert workers.next(0.0) is None
    client.outcome = "cancelled", None
    workers.submit(Job(print, 1))
    with pytest.raises(FleetError, match="the scheduler is lost: what was done is in the store"):
        workers.next(1.0)
    client.status = "closed"
    with pytest.raises(FleetError, match="the scheduler is lost"):
        workers.next(0.0)


@pytest.fixture(scope="module")
def executor():
    """Return an executor on a cluster of one worker."""
    with on_this_machine(1, 4_000_000_000, "127.0.0.1:0") as (workers, _):
        yield workers


def run_jobs(workers: OnDask, count: int) -> None:
    """Run jobs with one always in flight, as in a long run: Dask never sees the last one end."""
    for number in range(count):
        workers.submit(Job(abs, -number))
        if number:
            done = workers.next(10.0)
            assert done is not None and done.error is None


def test_the_names_of_tasks_that_are_over_are_forgotten(executor, monkeypatch):
    """Dask caches the name of each task, up to 100 000: over 10 000 tasks the client grew by 6 MB."""
    monkeypatch.setattr(cluster, "NAMES", 10)
    run_jobs(executor, 25)
    assert key_split.cache_info().currsize < 20


def test_the_scheduler_keeps_no_list_of_tasks_that_are_over(executor):
    """Dask's scheduler lists each submission of a span, without a bound: 0.6 kB a recording."""
    run_jobs(executor, 25)
    spans = executor._client.cluster.scheduler.extensions["spans"].spans.values()
    assert spans and all(len(span.metadata["collections"] if span.metadata else []) < 20 for span in spans)


def test_a_worker_allocates_memory_as_a_serial_run_does(monkeypatch):
    """Dask's MALLOC_TRIM_THRESHOLD_ maps each array of 128 kB anew: a bag took 0.65 s instead of 0.39 s."""
    monkeypatch.delenv("MALLOC_TRIM_THRESHOLD_", raising=False)
    with on_this_machine(1, 4_000_000_000, "127.0.0.1:0") as (workers, _):
        workers.submit(Job(os.getenv, "MALLOC_TRIM_THRESHOLD_"))
        done = workers.next(10.0)
    assert done is not None and done.error is None and done.value is None


def test_garbage_does_not_wait_until_it_is_a_quarter_of_all_modules():
    before = gc.get_freeze_count()
    with frequent_collection():
        assert gc.get_freeze_count() > 50_000
    assert gc.get_freeze_count() <= before


def test_a_lost_scheduler_leaves_no_traceback_of_dask_on_the_terminal(monkeypatch):
    """Its client logs 40 lines while it tries to connect again; the run says it in one line."""
    written = io.StringIO()
    terminal = logging.StreamHandler(written)
    monkeypatch.setattr(logging.getLogger("distributed"), "handlers", [terminal])

    def refused(*_, **__):
        logging.getLogger("distributed.client").error("Traceback")
        raise OSError("refused")

    monkeypatch.setattr(cluster.distributed, "Client", refused)
    with pytest.raises(FleetError, match="refused"), on_scheduler("tcp://127.0.0.1:1"):
        pass
    assert written.getvalue() == ""


MASK = """
import signal
from rsea_ros.fleet.cluster import on_this_machine
from rsea_ros.fleet.executor import Job
with on_this_machine(1, 4_000_000_000, "127.0.0.1:0") as (workers, _):
    workers.submit(Job(lambda _: signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, []), 0))
    print(workers.next(20.0).value)
"""


def test_a_worker_that_starts_does_not_hear_ctrl_c():
    """The first start of multiprocessing's tracker unblocked it: a worker printed a traceback."""
    command = [sys.executable, "-c", MASK]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout.strip() == "True"


@pytest.mark.parametrize("address", ["foo", "tcp://foo", "tcp://foo:port", ""])
def test_what_is_no_address_is_refused_at_once(address):
    """Dask waited a minute for its end, and then printed a traceback below the error."""
    with pytest.raises(FleetError, match=r"no address, expected .*tcp://HOST:8786"), on_scheduler(address):
        pass


def test_a_dashboard_that_cannot_be_is_named():
    """It was called a bug of this software."""
    with (
        pytest.raises(FleetError, match=r"^--dashboard nowhere\.invalid:1: .*, expected HOST:PORT"),
        on_this_machine(1, 10**9, "nowhere.invalid:1"),
    ):
        pass
