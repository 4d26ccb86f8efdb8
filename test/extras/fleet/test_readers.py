"""Readers of a store while a run writes, of files of an earlier version, and of a damaged one."""

from __future__ import annotations

import pytest
from fleet_stubs import KNEE, MARCH, stub_work
from pyarrow import parquet

from rsea_extras.fleet import FleetError, history, query, recordings
from rsea_extras.fleet.query import MergedError, answer
from rsea_extras.fleet.sources import Bag
from rsea_extras.fleet.store import read
from rsea_extras.fleet.task import Task

COUNT = "SELECT count(*) FROM recordings"


def put(store, number):
    store.put(stub_work(Task(Bag(f"/{number}", 1, ""), KNEE, f"{number:016x}", "1")))


@pytest.fixture
def merging(store, monkeypatch):
    """Return a store whose rows another process merges between the listing and the reading of its files."""
    for number in range(8):
        put(store, number)
    connect = query.duckdb.connect

    class Database:
        def __init__(self, database) -> None:
            self._database = database

        def __getattr__(self, name):
            return getattr(self._database, name)

        def __enter__(self):
            self._database.__enter__()
            return self

        def __exit__(self, *error):
            return self._database.__exit__(*error)

        def sql(self, text):
            relation = self._database.sql(text)
            store.compact()
            return relation

    monkeypatch.setattr(query.duckdb, "connect", lambda place: Database(connect(place)))
    return store


def test_files_that_a_run_merges_while_they_are_read_are_read_again(merging):
    """A report during a run ended with the advice to remove a damaged file."""
    assert answer(merging, COUNT)[1] == [(8,)]


def test_a_store_that_never_rests_says_so(store, monkeypatch):
    tries = []

    def never(path, text):
        tries.append(1)
        raise MergedError("busy")

    monkeypatch.setattr("rsea_extras.fleet.query._answer", never)
    with pytest.raises(MergedError):
        answer(store, COUNT)
    assert len(tries) == query.TRIES


def test_files_without_later_columns_are_read_and_merged(store):
    put(store, 1)
    (file,) = store.rows.rglob("*.parquet")
    parquet.write_table(read(file).drop_columns(["diagnosis", "stamp", "faults"]), file)
    assert answer(store, COUNT)[1] == [(1,)] and list(recordings(store.path)["verdict"]) == [""]
    assert len(history(store.path)["value"]) == 1
    keys, bags = store.known_rows()
    assert len(keys) == len(bags) == 1
    put(store, 2)
    store.compact()
    assert answer(store, "SELECT count(*), count(stamp) FROM recordings")[1] == [(2, 1)]


def put_at(store, path, content, day):
    outcome = stub_work(Task(Bag(path, 1, ""), KNEE, f"{content:016x}", "1"))
    outcome.row["time"] = day and MARCH.replace(day=day)
    store.put(outcome)


def test_a_recording_that_replaced_another_of_the_same_start_counts_alone(store):
    """A bag that was analysed while it was copied counted twice: its first half, and then the whole."""
    put_at(store, "/a.mcap", 1, 5)
    put_at(store, "/a.mcap", 2, 5)
    shown = answer(store, "SELECT recording FROM recordings")[1]
    assert shown == [(f"{2:016x}",)]
    assert answer(store, "SELECT count(*) FROM analyses")[1] == [(2,)]


def test_recordings_of_other_days_under_one_name_all_count(store):
    """A robot may write each day to the same path."""
    for content, day in ((1, 5), (2, 6), (3, None), (4, None)):
        put_at(store, "/latest.mcap", content, day)
    assert answer(store, COUNT)[1] == [(4,)]


@pytest.fixture
def damaged(store):
    """Return a store whose only file of rows is no Parquet file."""
    folder = store.rows / "joint=knee" / "month=2026-01"
    folder.mkdir(parents=True)
    (folder / "0123.parquet").write_text("junk")
    return store


@pytest.mark.parametrize(
    "read", [lambda s: s.known_rows(), lambda s: answer(s, "SELECT 1"), lambda s: history(s.path)]
)
def test_a_damaged_file_is_named_with_a_remedy(damaged, read):
    with pytest.raises(FleetError, match=r"0123\.parquet.*remove the damaged one"):
        read(damaged)
