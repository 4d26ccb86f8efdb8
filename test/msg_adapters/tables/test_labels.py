"""Rows chosen and split by texts, and trials of JSON."""

from __future__ import annotations

import json

import pytest

from msg_adapters.tables import import_records, load_map
from rsea_ros.errors import ImportMapError

CHANNELS = "channels:\n  command: {column: u, unit: N m}\n"
CSV = "t,phase,u\n0,rest,1\n1,chirp up/down,2\n2,chirp up/down,3\n3,rest,4\n4,,5\n"


def imported(folder, more, content=CSV, name="run.csv", time="{column: t, unit: s}", channels=CHANNELS):
    (folder / name).write_text(content)
    (folder / "map.yaml").write_text(f"time: {time}\n{more}\n{channels}")
    runs = import_records(folder / name, load_map(folder / "map.yaml"))
    return {one.name: one.record["command"].y.tolist() for one in runs}


def test_rows_are_chosen_by_a_text(tmp_path):
    assert imported(tmp_path, "where: {column: phase, equals: rest}") == {"": [1.0, 4.0]}


def test_runs_are_named_by_texts(tmp_path):
    runs = imported(tmp_path, "runs: {column: phase}")
    assert runs == {"-chirp_up_down": [2.0, 3.0], "-rest": [1.0, 4.0]}


def test_a_column_of_numbers_stays_one_whatever_another_row_lacks(tmp_path):
    content = "t,n,u\n0,1,1\n1,1.0,2\n2,2,3\n3,,4\n4,2,\n5,2,6\n"
    assert imported(tmp_path, "runs: {column: n}", content) == {"-run1": [1.0, 2.0], "-run2": [3.0, 6.0]}


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ("where: {column: phase, equals: Rest}", "left by where .phase is 'chirp up/down' or 'rest'"),
        ("where: {column: phase, below: 3}", "phase holds texts .*expected equals"),
        ("where: {column: t, equals: rest}", "where.equals is 'rest', expected a number .t goes from 0 to 4"),
    ],
)
def test_a_condition_that_does_not_go_with_the_column_names_what_is_there(more, message, tmp_path):
    with pytest.raises(ImportMapError, match=message):
        imported(tmp_path, more)


def trials(**more):
    up = [k / 10 for k in range(20)]
    return [{"type": "up", "i": up, **more}, {"type": "down", "i": [-one for one in up[::-1]], **more}]


def of_json(folder, document, more, time="{rate: 10}", column="data.i"):
    channels = f"channels:\n  command: {{column: {column}, unit: N m}}\n"
    return imported(folder, more, json.dumps(document), "run.json", time, channels)


@pytest.mark.parametrize(
    ("more", "names"),
    [
        ("runs: {column: data.type}", ["-down", "-up"]),
        ("runs: {column: data}", ["-run1", "-run2"]),
        ("where: {column: data.type, equals: up}", [""]),
        ("where: {column: data, equals: 2}", [""]),
    ],
)
def test_a_list_of_trials_is_read_trial_by_trial(more, names, tmp_path):
    runs = of_json(tmp_path, {"data": trials()}, more)
    assert list(runs) == names
    assert all(len(values) == 20 for values in runs.values())


@pytest.mark.parametrize(
    ("document", "more", "message"),
    [
        ({"data": trials()}, "", r"rows of 2 trials, .*runs: {column: data}"),
        ({"data": [*trials(), *trials()]}, "runs: {column: data.type}", "rows of 2 trials"),
        ({"data": trials(t=[0.0] * 19)}, "where: {column: data.t, below: 1}", "trial 1: data.i has 20"),
        ({"data": [{"i": [1, 2]}, {"i": [3, 4]}]}, "", r"expected a finite number: data.i\[0\]"),
    ],
)
def test_trials_are_never_joined(document, more, message, tmp_path):
    with pytest.raises(ImportMapError, match=message):
        of_json(tmp_path, document, more)
