"""`rsea fleet watch` over months: what goes wrong for a while does not end it."""

from __future__ import annotations

import pytest
from fleet_stubs import stub_work

from rsea_extras.cli import fleet
from rsea_extras.fleet import task
from rsea_ros.cli.main import main
from rsea_ros.processes import Stopped

MAP = "joints:\n  knee: {rig: paper_high_impedance}\n"


@pytest.fixture
def watch(tmp_path, folder, monkeypatch, capsys):
    """Return a function that watches the folder; between two looks the next of some actions is done."""
    monkeypatch.setattr(task, "work", stub_work)
    (tmp_path / "joints.yaml").write_text(MAP)

    def watch(*between):
        left = list(between)

        def sleep(seconds):
            if not left:
                raise Stopped(15)
            left.pop(0)()

        monkeypatch.setattr(fleet.time, "sleep", sleep)
        paths = [str(tmp_path / "new"), str(folder), "--map", str(tmp_path / "joints.yaml")]
        status = main(["fleet", "watch", *paths, "--serial"])
        said = capsys.readouterr()
        return status, said.out.splitlines(), said.err.splitlines()

    return watch


def test_a_share_that_is_away_for_a_while_does_not_end_the_watch(watch, folder):
    """It ended with status 2 at the first look without the folder."""
    away = folder.with_name("away")
    out_and_back = (lambda: folder.rename(away), lambda: None, lambda: away.rename(folder), lambda: None)
    status, out, err = watch(*out_and_back)
    assert status == 128 + 15
    assert out == ["5 done"]
    expected = f"rsea fleet: {folder}: no such file or folder, expected recordings: looking again"
    assert err == [expected, "rsea fleet: stopped by SIGTERM"]


def test_a_mistake_in_the_map_ends_the_first_look(watch, tmp_path):
    (tmp_path / "joints.yaml").write_text("joints: {}\n")
    status, out, err = watch()
    assert (status, out, len(err)) == (2, [], 1)
