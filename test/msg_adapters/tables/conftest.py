"""A function that imports a table by a map, for the tests of tables."""

from __future__ import annotations

import pytest
from map_files import CSV, MAP

from msg_adapters.tables import import_record, load_map


@pytest.fixture
def files(tmp_path):
    """Return a function that writes a map and a CSV file and imports them."""

    def run(map_text=MAP, csv_text=CSV, name="run.csv"):
        (tmp_path / "map.yaml").write_text(map_text)
        (tmp_path / name).write_text(csv_text)
        return import_record(tmp_path / name, load_map(tmp_path / "map.yaml"))

    return run
