"""What `rsea fleet run` says of its sources, its map, and of a signal that stops it."""

from __future__ import annotations

import signal
from argparse import Namespace

import pytest
from fleet_stubs import HIP, KNEE, stub_work

from rsea_extras.cli import fleet
from rsea_extras.fleet import task
from rsea_extras.fleet.sources import bags_of
from rsea_ros.processes import Stopped

MAP = """joints:
  knee: {rig: paper_high_impedance, bags: '*'}
  hip: {rig: paper_high_impedance, bags: hip/*}
"""


def test_a_map_that_fits_no_recording_is_refused(call, tmp_path, folder):
    """A wrong pattern gave `nothing new`, status 0 and an empty store."""
    status, out, err = call("run", folder, "--out", tmp_path / "new", joints=MAP.replace("'*'", "knees/*"))
    assert (status, out, len(err)) == (2, [], 1)
    assert "recordings, of no joint of" in err[0] and str(folder) in err[0]
    assert not (tmp_path / "new").exists()


def test_a_joint_without_a_recording_is_named(call, tmp_path, folder):
    status, out, _ = call("run", folder, "--out", tmp_path / "new", joints=MAP)
    assert status == 0
    assert "no recording of hip: no path matches its bags: hip/*" in out


def test_a_signal_says_how_many_recordings_are_left(folder, tmp_path, monkeypatch):
    """It said only that it was stopped."""
    worked = []

    def stopped_at_the_third(job):
        if len(worked) == 2:
            raise Stopped(signal.SIGTERM)
        worked.append(job)
        return stub_work(job)

    monkeypatch.setattr(task, "work", stopped_at_the_third)
    held = bags_of([str(folder)], (KNEE, HIP))
    args = Namespace(serial=True, scheduler=None, no_wait=True, again=False, time_limit=60.0, pages=False)
    with pytest.raises(Stopped) as caught:
        fleet.write_rows(args, str(tmp_path / "new"), held)
    total = 2 * len(held)
    assert caught.value.note == f"{total - 2} of {total} recordings are left, run the same line again"
