"""The executor on Dask, against a client that stands in for it: what is in flight, and what is lost."""

from __future__ import annotations

import io
import logging
from types import SimpleNamespace

import pytest

from rsea_extras.fleet import FleetError
from rsea_extras.fleet.pool import Job, WorkerLost


@pytest.fixture(scope="module")
def cluster():
    """The module on Dask: a quarter of a second in each worker, were it imported above."""
    from rsea_extras.fleet import cluster

    return cluster


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


@pytest.mark.parametrize(("is_killed", "error"), [(True, WorkerLost), (False, ValueError)])
def test_an_error_comes_back_with_its_job(cluster, is_killed, error):
    client, job = Client(), Job(print, 1)
    killed = cluster.KilledWorker("task", SimpleNamespace(address="tcp://x"), 0)
    client.outcome = "error", killed if is_killed else ValueError("no")
    workers = cluster.OnDask(client)
    workers.submit(job)
    done = workers.next(1.0)
    assert done is not None and done.job == job and isinstance(done.error, error)


def test_a_lost_scheduler_ends_the_run(cluster):
    client = Client()
    workers = cluster.OnDask(client)
    assert workers.next(0.0) is None
    client.outcome = "cancelled", None
    workers.submit(Job(print, 1))
    with pytest.raises(FleetError, match="the scheduler is lost: what was done is in the store"):
        workers.next(1.0)
    client.status = "closed"
    with pytest.raises(FleetError, match="the scheduler is lost"):
        workers.next(0.0)


def test_a_lost_scheduler_leaves_no_traceback_of_dask_on_the_terminal(cluster, monkeypatch):
    """Its client logs 40 lines while it tries to connect again; the run says it in one line."""
    written = io.StringIO()
    terminal = logging.StreamHandler(written)
    monkeypatch.setattr(logging.getLogger("distributed"), "handlers", [terminal])

    def refused(*_, **__):
        logging.getLogger("distributed.client").error("Traceback")
        raise OSError("refused")

    monkeypatch.setattr(cluster.distributed, "Client", refused)
    with pytest.raises(FleetError, match="refused"), cluster.on_scheduler("tcp://127.0.0.1:1"):
        pass
    assert written.getvalue() == ""


@pytest.mark.parametrize("address", ["foo", "tcp://foo", "tcp://foo:port", ""])
def test_what_is_no_address_is_refused_at_once(cluster, address):
    """Dask waited a minute for its end, and then printed a traceback below the error."""
    told = r"no address, expected .*tcp://HOST:8786"
    with pytest.raises(FleetError, match=told), cluster.on_scheduler(address):
        pass
