"""A new store, and files that stand for bags."""

from __future__ import annotations

from pathlib import Path

import pytest

from rsea_extras.fleet.store import Store, open_store


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return open_store(tmp_path / "store", create=True)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return a folder of five files that stand for bags."""
    folder = tmp_path / "bags"
    folder.mkdir()
    for number in range(5):
        (folder / f"run{number}.mcap").write_bytes(bytes([number]) * 1000)
    return folder
