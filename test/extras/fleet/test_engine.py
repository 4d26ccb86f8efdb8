"""The engine: only new recordings, nothing lost and nothing twice, whatever is killed."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections import deque
from dataclasses import replace
from pathlib import Path

import pytest
from fleet_stubs import HIP, KNEE, stub_work

from rsea_extras.fleet import FleetError, engine as engines, store as compaction
from rsea_extras.fleet.engine import ATTEMPTS, Engine, EngineLimits
from rsea_extras.fleet.pool import Done, Serial, WorkerLost
from rsea_extras.fleet.query import answer
from rsea_extras.fleet.sources import Bag, bags_of
from rsea_extras.fleet.store import TaskOutcome, hold_lock, open_store
from rsea_extras.fleet.task import Changed, Task, are_new


def run_engine(store, folder, joints=(KNEE,), executor=None, work=stub_work, limits=None):
    held = bags_of([str(folder)], joints)
    return Engine(store, executor or Serial(), work, lambda step, share: None, limits).run(held)


def count(store, outcome="done"):
    return answer(store, f"SELECT count(*) FROM analyses WHERE outcome = '{outcome}'")[1][0][0]


class Unlucky(Serial):
    """An executor that loses the worker of some tasks; of several jobs in flight the newest ends first."""

    places = 3

    def __init__(self, losses: dict[str, int]) -> None:
        super().__init__()
        self.losses = losses

    def next(self, timeout: float | None) -> Done | None:
        self._jobs = deque(reversed(self._jobs))
        job = self._jobs[0]
        name = Path(getattr(job.argument, "bag", job.argument).url).name
        if isinstance(job.argument, Task) and job.attempt < self.losses.get(name, 0):
            self._jobs.popleft()
            return Done(job, error=WorkerLost("killed"))
        return super().next(timeout)


def test_a_second_run_finds_nothing_new(store, folder):
    assert run_engine(store, folder).outcomes == {"done": 5}
    assert not any(are_new(store, bags_of([str(folder)], [KNEE])))
    again = run_engine(store, folder, work=lambda task: pytest.fail("worked on a known recording"))
    assert (again.rows, again.before) == (0, 5)
    assert count(store) == 5


def test_a_bag_that_moved_is_known_by_its_content(store, folder, tmp_path):
    run_engine(store, folder)
    moved = folder.rename(tmp_path / "elsewhere")
    assert any(are_new(store, bags_of([str(moved)], [KNEE])))
    summary = run_engine(store, moved)
    assert (summary.rows, summary.before) == (0, 5)


def test_other_settings_and_another_joint_are_new(store, folder):
    run_engine(store, folder)
    assert run_engine(store, folder, [KNEE, HIP]).outcomes == {"done": 5}
    assert run_engine(store, folder, [replace(KNEE, diagnose="always")]).outcomes == {"done": 5}
    assert count(store) == 15
    assert answer(store, "SELECT count(*) FROM recordings")[1] == [(10,)], "the newest analysis of each"


def test_a_lost_worker_is_replaced_and_a_recording_that_kills_workers_is_quarantined(store, folder):
    losses = {"run1.mcap": 2, "run3.mcap": 1000}
    summary = run_engine(store, folder, executor=Unlucky(losses), limits=EngineLimits(back_off=0.001))
    assert summary.outcomes == {"done": 4, "quarantined": 1}
    ((joint, bag, why),) = summary.quarantined
    assert joint == "knee" and bag.endswith("run3.mcap") and f"all {ATTEMPTS} times" in why
    assert run_engine(store, folder).rows == 0, "poison is not tried again by itself"
    store.take_out({"quarantined"})
    assert run_engine(store, folder).outcomes == {"done": 1}
    assert (count(store), count(store, "quarantined")) == (5, 0)


def test_an_error_of_the_cluster_is_a_row_and_not_the_end(store, folder):
    def work(task: Task):
        if task.bag.url.endswith("run2.mcap"):
            raise TypeError("cannot pickle it")
        return stub_work(task)

    assert run_engine(store, folder, work=work).outcomes == {"done": 4, "quarantined": 1}
    assert answer(store, "SELECT reason FROM recordings WHERE outcome = 'quarantined'")[1] == [
        ("TypeError: cannot pickle it",)
    ]


def test_a_bag_too_large_for_a_worker_never_reaches_one(store, folder):
    with (folder / "run4.mcap").open("ab") as file:
        file.truncate(4_000_000_000)  # of which the disk holds nothing
    limit = EngineLimits(memory=int(engines.BASE + engines.FACTOR * 1e6))
    held = [(bag, joints) for bag, joints in bags_of([str(folder)], [KNEE])]
    engine = Engine(store, Serial(), stub_work, lambda step, share: None, limit)
    engine._recordings = {(bag.url, bag.size, bag.stamp): f"{k:016x}" for k, (bag, _) in enumerate(held)}
    summary = engine.run(held)
    assert summary.outcomes == {"done": 4, "quarantined": 1}
    assert "4000 MB" in summary.quarantined[0][2] and "--memory" in summary.quarantined[0][2]


def test_a_bag_that_is_being_written_is_left_for_the_next_run(store, folder):
    def work(task: Task):
        if task.bag.url.endswith("run2.mcap"):
            raise Changed(task.bag.url)
        return stub_work(task)

    summary = run_engine(store, folder, work=work)
    assert (summary.rows, len(summary.changed)) == (4, 1)
    assert run_engine(store, folder).outcomes == {"done": 1}
    assert count(store) == 5


def test_a_full_disk_ends_the_run_and_loses_no_row(store, folder, monkeypatch):
    """The engine says so; what was written stays, and the next run writes the rest."""
    written = []
    put = type(store).put

    def full(self, outcome):
        if len(written) == 2:
            raise OSError(28, "No space left on device")
        written.append(outcome)
        put(self, outcome)

    monkeypatch.setattr(type(store), "put", full)
    with pytest.raises(OSError, match="No space left"):
        run_engine(store, folder)
    monkeypatch.undo()
    assert count(store) == 2
    assert run_engine(store, folder).outcomes == {"done": 3}
    assert count(store) == 5


def test_a_compaction_killed_half_way_leaves_no_row_twice(store, folder, monkeypatch):
    monkeypatch.setattr("rsea_extras.fleet.store._remove", lambda folder, names: None)
    run_engine(store, folder)
    monkeypatch.undo()
    assert len(list(store.rows.rglob("*.parquet"))) == 6
    assert count(store) == 5, "who reads counts them once"
    store.finish()
    assert len(list(store.rows.rglob("*.parquet"))) == 1
    assert count(store) == 5


def test_a_row_made_again_outlives_a_compaction_that_named_its_file(store, folder, monkeypatch):
    """Finishing a compaction must not remove a new file with the name of a compacted one."""

    def work(task: Task):
        poison = {"outcome": "quarantined"} if task.bag.url.endswith("run2.mcap") else {}
        return TaskOutcome(stub_work(task).row | poison)

    run_engine(store, folder, work=work)
    store.take_out({"quarantined"})
    monkeypatch.setattr(type(store), "compact", lambda self: None)  # killed before it
    run_engine(store, folder)
    store.finish()
    assert count(store) == 5


def test_two_runs_take_turns(store):
    """Another process holds the lock: a run that does not wait names it, one that waits begins after it."""
    code = f"""
import time
from rsea_extras.fleet.store import TaskOutcome, hold_lock, open_store
with hold_lock(open_store({str(store.path)!r}), None):
    print("held", flush=True)
    time.sleep(30)
"""
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) as other:
        assert other.stdout is not None and other.stdout.readline() == "held\n"
        with pytest.raises(FleetError, match=f"process {other.pid} on "), hold_lock(store, None):
            pass
        begin, heard = time.monotonic(), []

        def wait(holder: str) -> None:
            heard.append(holder)
            os.kill(other.pid, 9)

        with hold_lock(store, wait):
            assert heard and time.monotonic() - begin < 10.0


def test_a_folder_that_is_no_store_is_refused(tmp_path, folder):
    for path, create in ((folder, True), (tmp_path / "nothing", False)):
        with pytest.raises(FleetError, match="expected a store"):
            open_store(path, create=create)
    (tmp_path / "later").mkdir()
    (tmp_path / "later" / "store.json").write_text('{"schema": 99}')
    with pytest.raises(FleetError, match="schema 99, expected 1"):
        open_store(tmp_path / "later")


def test_new_rows_are_merged_without_reading_those_merged_before(store, monkeypatch):
    """A merge that read its whole partition grew the memory of a run, and its time as n²."""
    monkeypatch.setattr("rsea_extras.fleet.store.LOOSE", 4)
    opened, read = [], compaction.read
    monkeypatch.setattr(compaction, "read", lambda file: opened.append(file.name) or read(file))
    for number in range(16):
        store.put(stub_work(Task(Bag(f"/{number}", 1, ""), KNEE, f"{number:016x}", "1")))
    assert len(opened) == len(set(opened)) == 16, "each row is read by one merge"
    assert len(list(store.rows.rglob("*.parquet"))) == 4
    store.compact()
    assert len(list(store.rows.rglob("*.parquet"))) == 1
    assert answer(store, "SELECT count(*), count(DISTINCT recording) FROM recordings")[1] == [(16, 16)]
