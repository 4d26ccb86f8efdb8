"""A run survives: lost workers, clients and schedulers, a full disk, poison, another run beside it."""

from __future__ import annotations

import os
import random
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from bench import ROOT
from bench.fleet import stub
from rsea_ros.errors import RseaError
from rsea_ros.fleet.cluster import on_scheduler
from rsea_ros.fleet.executor import serial
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
            import json

            stub.wait_for(file.exists, 60.0)
            time.sleep(0.5)
            yield json.loads(file.read_text())["address"], scheduler
        finally:
            for process in (worker, scheduler):
                process.terminate()
                process.wait()


def disk_full(count: int = 200) -> bool:
    """Let the store's file system run full (a small tmpfs, needs root), give it room, and go on."""
    with place(count) as (bags, path):
        path.mkdir()
        small = ["mount", "-t", "tmpfs", "-o", "size=600k", "tmpfs", str(path)]
        if subprocess.run(small, check=False).returncode:
            print("disk full                    not measured: needs root, who can mount a small file system")
            return True
        try:
            store, said, os.environ[stub.TAKES] = open_store(path, create=True), "never full", "0"
            with hold_lock(store, None), serial() as serial_run:
                try:
                    stub.run_engine(store, bags, serial_run)
                except OSError as error:
                    said = f"stopped with {error.strerror}"
            before = len(stub.outcomes(store)) and sum(stub.outcomes(store).values())
            subprocess.run(["mount", "-o", "remount,size=20m", str(path)], check=True)
            with hold_lock(store, None), serial() as serial_run:
                store.finish()
                stub.run_engine(store, bags, serial_run)
            return verdict("disk full", path, count, f"{said} after {before} rows, which stayed")
        finally:
            subprocess.run(["umount", str(path)], check=False)


def four_gigabytes(count: int = 8) -> bool:
    """Have one recording take 4 GB on workers that may have 1 GB."""
    with place(count) as (bags, path), on_this_machine(2, MEMORY) as workers:
        summary = stub.run_engine(open_store(path, create=True), bags, workers, stub.greedy)
        good = summary.outcomes == {"done": count - 1, "quarantined": 1}
        why = summary.quarantined[0][2] if summary.quarantined else "no quarantine"
        return verdict("4 GB on 1 GB", path, count, f"{summary.sentence()}: {why}") and good


def two_at_once(count: int = 40) -> bool:
    """Start two whole runs on one store at once."""
    with place(count) as (bags, path):
        open_store(path, create=True)
        runs = [_client(bags, path, "0.1") for _ in range(2)]
        states = [run.wait(timeout=200.0) for run in runs]
        return verdict("two runs at once", path, count, f"exit status {states}")


def truncate_while_read() -> bool:
    """Truncate a real recording while it is read: no row; the next run reads the rest of it."""
    from bench.fleet.real import make_fleet, run_real

    with tempfile.TemporaryDirectory(prefix="rsea-bench-") as folder:
        held = make_fleet(Path(folder) / "bags", 3, seconds=6.0)
        store = open_store(Path(folder) / "store", create=True)
        first = run_real(store, held, cut="002")
        shutil.copy(Path(folder) / "bags" / "knee-001.mcap", Path(folder) / "bags" / "whole.mcap")
        second = run_real(store, held)
        said = f"first {first.sentence()}; then {second.sentence()}"
        return verdict("truncated while read", store.path, 3, said)


ALL = (
    workers_killed,
    client_killed,
    scheduler_killed,
    disk_full,
    four_gigabytes,
    two_at_once,
    truncate_while_read,
)


def main(argv: Sequence[str]) -> int:
    """Run all, or those named; return the exit status."""
    passed = [one() for one in ALL if not argv or one.__name__ in argv]
    return 0 if all(passed) else 1
