"""Files of one row become files of many, at a cost that does not grow with the store."""

from __future__ import annotations

from fleet_stubs import KNEE, stub_work

from rsea_ros.fleet import row as compaction
from rsea_ros.fleet.query import answer
from rsea_ros.fleet.sources import Bag
from rsea_ros.fleet.task import Task


def test_new_rows_are_merged_without_reading_those_merged_before(store, monkeypatch):
    """A merge that read its whole partition grew the memory of a run, and its time as n²."""
    monkeypatch.setattr("rsea_ros.fleet.store.LOOSE", 4)
    opened, read = [], compaction.read
    monkeypatch.setattr(compaction, "read", lambda file: opened.append(file.name) or read(file))
    for number in range(16):
        store.put(stub_work(Task(Bag(f"/{number}", 1, ""), KNEE, f"{number:016x}", "1")))
    assert len(opened) == len(set(opened)) == 16, "each row is read by one merge"
    assert len(list(store.rows.rglob("*.parquet"))) == 4
    store.compact()
    assert len(list(store.rows.rglob("*.parquet"))) == 1
    assert answer(store, "SELECT count(*), count(DISTINCT recording) FROM recordings")[1] == [(16, 16)]
