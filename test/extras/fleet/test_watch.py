"""`rsea fleet watch` over months: what goes wrong for a while does not end it."""

from __future__ import annotations

import pytest

from rsea_extras.cli import fleet
from rsea_ros.processes import Stopped


@pytest.fixture
def watch(tmp_path, folder, call, monkeypatch):
    """Return a function that watches the folder; between two looks the next of some actions is done."""

    def watch(*between, **joints):
        left = list(between)

        def sleep(seconds):
            if not left:
                raise Stopped(15)
            left.pop(0)()

        monkeypatch.setattr(fleet.time, "sleep", sleep)
        return call("watch", tmp_path / "new", folder, **joints)

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


def test_a_mistake_in_the_map_ends_the_first_look(watch):
    status, out, err = watch(joints="joints: {}\n")
    assert (status, out, len(err)) == (2, [], 1)
