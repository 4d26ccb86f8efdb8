"""Workers of this machine: no port, lost ones are replaced, and memory has a limit."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

import pytest

from rsea_extras.fleet.pool import Done, Job, Pool, WorkerLost, on_this_machine

MEMORY = 2_000_000_000


@pytest.fixture(scope="module")
def pool():
    with on_this_machine(2, MEMORY) as workers:
        yield workers


def outcome(pool: Pool, job: Job) -> Done:
    pool.submit(job)
    done = pool.next(60.0)
    assert done is not None and done.job == job
    return done


def sockets(pid: int) -> set[str]:
    """Return the inodes of the sockets of a process."""
    found = set()
    for link in Path(f"/proc/{pid}/fd").iterdir():
        with suppress(FileNotFoundError):  # that of this listing
            found.add(os.readlink(link))
    return {link[8:-1] for link in found if link.startswith("socket:[")}


def network(pid: int) -> set[str]:
    """Return the inodes of all TCP and UDP sockets that a process sees."""
    tables = [Path(f"/proc/{pid}/net/{name}").read_text() for name in ("tcp", "tcp6", "udp", "udp6")]
    return {line.split()[9] for table in tables for line in table.splitlines()[1:]}


def test_no_worker_and_no_client_has_a_port(pool):
    """A scheduler on 127.0.0.1 ran what any local user sent, with the rights of whoever started it."""
    before = network(os.getpid()) & sockets(os.getpid())
    assert outcome(pool, Job(eval, "__import__('os').getpid()")).value != os.getpid()
    for worker in pool._workers:
        assert not sockets(worker.process.pid) & network(worker.process.pid)
    assert network(os.getpid()) & sockets(os.getpid()) == before


def test_ctrl_c_is_left_to_the_client(pool):
    ignored = "__import__('signal').getsignal(2) == __import__('signal').SIG_IGN"
    assert outcome(pool, Job(eval, ignored)).value is True
    beside = "__import__('threading').current_thread() is not __import__('threading').main_thread()"
    assert outcome(pool, Job(eval, beside)).value is True, "limit_time ends a worker that hangs, no client"


def test_an_error_comes_back_with_its_job_even_one_that_cannot_be_sent(pool):
    assert isinstance(outcome(pool, Job(int, "no")).error, ValueError)
    odd = "type('Odd', (Exception,), {})"
    assert "Odd" in str(outcome(pool, Job(exec, f"raise {odd}('Odd')")).error)
    assert outcome(pool, Job(abs, -3)).value == 3


def test_a_lost_worker_is_replaced_and_its_job_comes_back(pool):
    die = Job(eval, "__import__('os').kill(__import__('os').getpid(), 9)")
    for _ in range(3):
        assert isinstance(outcome(pool, die).error, WorkerLost)
    assert outcome(pool, Job(abs, -1)).value == 1


def test_a_worker_that_takes_more_memory_than_it_may_is_lost():
    with on_this_machine(1, 300_000_000) as pool:
        grow = "[b'1' * 350_000_000, __import__('time').sleep(60)]"
        assert isinstance(outcome(pool, Job(eval, grow)).error, WorkerLost)
