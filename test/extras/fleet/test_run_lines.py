"""What `rsea fleet run` says of its sources, its map, and of a signal that stops it."""

from __future__ import annotations

import signal
from argparse import Namespace

import pytest
from fleet_stubs import HIP, KNEE, stub_work

from rsea_extras.cli import fleet
from rsea_extras.fleet import task
from rsea_extras.fleet.sources import bags_of
from rsea_ros.cli.main import main
from rsea_ros.processes import Stopped

MAP = """joints:
  knee: {rig: paper_high_impedance, bags: '*'}
  hip: {rig: paper_high_impedance, bags: hip/*}
"""


@pytest.fixture
def run(tmp_path, folder, monkeypatch, capsys):
    """Return a function that runs a map over the folder with stubs: status, and the lines printed."""
    monkeypatch.setattr(task, "work", stub_work)

    def run(text, *sources):
        (tmp_path / "joints.yaml").write_text(text)
        paths = ["--map", str(tmp_path / "joints.yaml"), "--out", str(tmp_path / "new")]
        status = main(["fleet", "run", str(folder), *sources, *paths, "--serial"])
        said = capsys.readouterr()
        return status, said.out.splitlines(), said.err.splitlines()

    return run


def test_a_map_that_fits_no_recording_is_refused(run, tmp_path, folder):
    """A wrong pattern gave `nothing new`, status 0 and an empty store."""
    status, out, err = run(MAP.replace("'*'", "knees/*"))
    assert (status, out, len(err)) == (2, [], 1)
    assert "recordings, of no joint of" in err[0] and str(folder) in err[0]
    assert not (tmp_path / "new").exists()


def test_a_joint_without_a_recording_is_named(run):
    status, out, _ = run(MAP)
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
