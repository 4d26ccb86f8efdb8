"""A function that imports a table by a map, and readers in forks, for the tests of tables."""

import json
import os
import resource
import runpy
import subprocess
import sys
from types import SimpleNamespace

import pytest
from bad_input import forked
from map_files import CSV, MAP

from msg_adapters.tables import column_files, import_record, load_map

PROGRAM = str(column_files.PROGRAM)


@pytest.fixture(autouse=True)
def readers_in_forks(monkeypatch):
    """Run readers in forks that have imported scipy and pyarrow, without limits: 0.2 s of CPU less each."""

    def run(command, stdout, **options):
        program, kind, path, limit, places = command[-5:]
        if program != PROGRAM:
            return subprocess.run(command, stdout=stdout, **options)

        def read():
            os.dup2(stdout.fileno(), 1)
            with open(1, "w") as sys.stdout:
                resource.setrlimit = lambda *limit: None  # this process may have more memory already
                runpy.run_path(program)["main"](kind, path, int(limit), json.loads(places))

        return SimpleNamespace(returncode=forked(read))

    monkeypatch.setattr(column_files, "subprocess", SimpleNamespace(**{**vars(subprocess), "run": run}))


@pytest.fixture
def files(tmp_path):
    """Return a function that writes a map and a CSV file and imports them."""

    def run(map_text=MAP, csv_text=CSV, name="run.csv"):
        (tmp_path / "map.yaml").write_text(map_text)
        (tmp_path / name).write_text(csv_text)
        return import_record(tmp_path / name, load_map(tmp_path / "map.yaml"))

    return run
