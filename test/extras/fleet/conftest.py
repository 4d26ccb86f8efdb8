"""A new store, files that stand for bags, and the actions of `rsea fleet` on them."""

from __future__ import annotations

from pathlib import Path

import pytest
from fleet_stubs import stub_work

from rsea_extras.fleet import task
from rsea_extras.fleet.store import Store, open_store
from rsea_ros.cli.main import main

MAP = "joints:\n  knee: {rig: paper_high_impedance}\n"


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


@pytest.fixture
def call(tmp_path, folder, monkeypatch, capsys):
    """Return a function that calls `rsea fleet` with stubs of tasks: status, and the lines printed.

    joints: text of the map.
    """
    monkeypatch.setattr(task, "work", stub_work)

    def call(*words, joints=MAP):
        (tmp_path / "joints.yaml").write_text(joints)
        status = main(["fleet", *map(str, words), "--map", str(tmp_path / "joints.yaml"), "--serial"])
        said = capsys.readouterr()
        return status, said.out.splitlines(), said.err.splitlines()

    return call
