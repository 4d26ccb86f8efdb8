"""A run survives lost workers, clients and schedulers.

A full disk, recordings that take too much memory or change while they are read, and two runs at once: tests.
"""

from __future__ import annotations

import json
import os
import random
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

from bench import ROOT
from bench.fleet import stub
from rsea_ros.errors import RseaError
from rsea_ros.fleet.cluster import on_scheduler
from rsea_ros.fleet.pool import on_this_machine
from rsea_ros.fleet.store import Store, hold_lock, open_store

KILLS = 20
MEMORY = 1_000_000_000


@contextmanager
def place(count: int) -> Iterator[tuple[Path, Path]]:
    """Yield a folder of stub recordings and the path of a future store."""
    with tempfile.TemporaryDirectory(prefix="rsea-bench-") as folder:
        yield stub.make_bags(Path(folder) / "bags", count), Path(folder) / "store"


def verdict(name: str, store: Path, count: int, more: str) -> bool:
    """Print the rows of a store beside the expected ones; return whether every recording is there once."""
    held, apart = stub.rows(open_store(store))
    good = held == apart == count
    print(f"{name:<28} {count - apart} lost, {held - apart} double of {count}; {more}"
          f"{'' if good else '  WRONG'}", flush=True)  # fmt: skip
    return good


def workers_killed(count: int = 60) -> bool:
    """Kill a worker at random times while a run goes on."""
    random.seed(1)
    with place(count) as (bags, path), on_this_machine(2, MEMORY) as workers:
        store, killed, over = open_store(path, create=True), [], threading.Event()

        def kill() -> None:
            while len(killed) < KILLS and not over.wait(random.uniform(0.2, 1.5)):
                alive = [n.pid for n in workers._client.cluster.workers.values() if n.pid]
                if alive:
                    os.kill(victim := random.choice(alive), 9)
                    killed.append(victim)

        os.environ[stub.TAKES] = "0.5"
        killer = threading.Thread(target=kill)
        killer.start()
        summary = stub.run_engine(store, bags, workers)
        over.set()
        killer.join()
        return verdict("worker killed", path, count, f"{len(killed)} kills, {summary.sentence()}")


def client(folder: str, path: str) -> None:
    """Run a whole run with its cluster, as a client that can be killed."""
    store = open_store(path, create=True)
    with hold_lock(store, lambda holder: None), on_this_machine(1, MEMORY) as workers:
        store.finish()
        stub.run_engine(store, Path(folder), workers)


def _client(bags: Path, store: Path, seconds: str = "0.2") -> subprocess.Popen[bytes]:
    code = "import sys, rsea_ros.cli; from bench.fleet.faults import client; client(*sys.argv[1:])"
    command = [sys.executable, "-c", code, str(bags), str(store)]
    environment = {**os.environ, stub.TAKES: seconds}
    return subprocess.Popen(command, cwd=ROOT, env=environment, stderr=subprocess.DEVNULL)


def client_killed(count: int = 40, kills: int = 4) -> bool:
    """Kill client, scheduler and nannies, which are one process, after some rows; then run to the end."""
    with place(count) as (bags, path):
        store = open_store(path, create=True)
        for kill in range(kills):
            running = _client(bags, path)
            _kill_after(running, store, stub.count_row_files(store) + 3 + kill)
            running.wait()
        done = stub.count_row_files(store)
        _client(bags, path).wait(timeout=120.0)
        return verdict("client and scheduler killed", path, count, f"{kills} kills, {done} rows at the last")


def scheduler_killed(count: int = 30) -> bool:
    """Kill a scheduler that runs by itself; run again on another."""
    with place(count) as (bags, path):
        store, said = open_store(path, create=True), "the run went on"
        os.environ[stub.TAKES] = "0.2"
        for kill in (True, False):
            with _cluster() as (address, scheduler):
                if kill:
                    threading.Thread(target=_kill_after, args=(scheduler, store, 5), daemon=True).start()
                try:
                    with on_scheduler(address) as cluster_run:
                        stub.run_engine(store, bags, cluster_run)
                except RseaError as error:
                    said = str(error).split(":")[0]
        return verdict("scheduler killed", path, count, f"first run: {said}")


def _kill_after(process: subprocess.Popen[bytes], store: Store, least: int) -> None:
    stub.wait_for(lambda: stub.count_row_files(store) >= least or process.poll() is not None, 120.0)
    process.kill()


@contextmanager
def _cluster() -> Iterator[tuple[str, subprocess.Popen[bytes]]]:
    """Yield the address of a scheduler with one worker, both processes of their own."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "scheduler.json"
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        env = {**os.environ, "PYTHONPATH": str(ROOT)}
        common = ["--no-dashboard", "--scheduler-file", str(file)]
        dask = [sys.executable, "-m", "dask"]
        host = ["--host", "127.0.0.1", "--port", "0"]
        scheduler = subprocess.Popen([*dask, "scheduler", *host, *common], env=env, **quiet)
        alone = ["--nthreads", "1", "--no-nanny"]
        worker = subprocess.Popen([*dask, "worker", *alone, *common], env=env, **quiet)
        try:
            stub.wait_for(file.exists, 60.0)
            time.sleep(0.5)
            yield json.loads(file.read_text())["address"], scheduler
        finally:
            for process in (worker, scheduler):
                process.terminate()
                process.wait()


ALL = {one.__name__: one for one in (workers_killed, client_killed, scheduler_killed)}


def main(parts: Annotated[tuple[str, ...], ALL] = ()) -> int:
    """Run all, or those named; return the exit status."""
    return int(any([not ALL[name]() for name in parts or ALL]))  # noqa: C419 all of them are run
