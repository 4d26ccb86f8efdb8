"""A store with a damaged file, and sources without a recording: one line, exit status 2."""

from __future__ import annotations

import pytest

from rsea_ros.fleet import FleetError, history
from rsea_ros.fleet.query import answer


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
