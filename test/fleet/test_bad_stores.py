"""A store with a damaged file, and sources without a recording: one line, exit status 2."""

from __future__ import annotations

import pytest

from rsea_ros.cli.main import main
from rsea_ros.fleet import history
from rsea_ros.fleet.fleet_error import FleetError
from rsea_ros.fleet.query import answer

MAP = "joints:\n  knee: {rig: paper_high_impedance}\n"


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


def test_a_folder_without_recordings_is_refused_before_a_store_is_made(tmp_path, capsys):
    (tmp_path / "empty").mkdir()
    (tmp_path / "joints.yaml").write_text(MAP)
    out = tmp_path / "store"
    files = [str(tmp_path / name) for name in ("empty", "joints.yaml", "store")]
    assert main(["fleet", "run", files[0], "--map", files[1], "--out", files[2]]) == 2 and not out.exists()
    assert "empty: no recording, expected .mcap or .db3 files" in capsys.readouterr().err
