"""Bags with bad samples are used without them; one that may not be read is refused in one line."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from bad_input import ROOT, change, rsea

from msg_adapters import write_record
from rsea_ros.cli.main import main


@pytest.mark.parametrize("value", [np.nan, 1e31])
def test_identify_masks_and_reports_a_measurement_that_is_no_number(record, tmp_path, value):
    """It refused what diagnose and predict mask."""
    write_record(change(record, "ft", 7, y=value), tmp_path / "bag")
    done = rsea("identify", tmp_path / "bag", "--out", tmp_path / "results")
    assert (done.returncode, done.stderr) == (0, "")
    faults = json.loads((tmp_path / "results" / "identification.json").read_text())["data"]["faults"]
    assert ("nan", "ft") in {(fault["kind"], fault["channel"]) for fault in faults}


@pytest.mark.parametrize(
    ("sample", "stamp", "kinds"),
    [(9, 3.3 / 280, ["stray_stamps", "dropped_samples"]), (11, 13.5 / 280, ["out_of_order"])],
)
def test_a_stamp_that_goes_back_is_reported_and_the_rest_is_used(record, tmp_path, sample, stamp, kinds):
    write_record(change(record, "ft", sample, t=stamp), tmp_path / "bag")
    assert main(["identify", str(tmp_path / "bag"), "--out", str(tmp_path / "found")]) == 0
    faults = json.loads((tmp_path / "found" / "identification.json").read_text())["data"]["faults"]
    assert [(f["kind"], f["channel"], f["size"]) for f in faults] == [(kind, "ft", 1) for kind in kinds]


NOBODY = 65534


def as_nobody(*arguments: str | Path, once: tuple[str | Path, ...] = ()) -> subprocess.CompletedProcess[str]:
    """Run a verb without root's rights. once: run it as root before, so that its imports are compiled."""
    code = (
        "import contextlib, io, os, sys, msg_adapters, rsea_ros.cli.identify, rsea_ros.model.rig_file\n"
        "from rsea_ros.cli.main import main\n"
        f"once = {[str(a) for a in once]}\n"
        "with contextlib.redirect_stdout(io.StringIO()): assert not once or main(once) == 0\n"
        f"os.geteuid() or os.seteuid({NOBODY})\n"
        f"sys.exit(main({[str(a) for a in arguments]}))"
    )
    return subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)


def reachable(folder: Path) -> None:
    for one in (folder, *folder.parents[:-2]):
        one.chmod(0o755)


def test_a_file_without_read_permission_is_refused(record, tmp_path):
    for name in ("open.mcap", "locked.mcap"):
        write_record(record, tmp_path / name)
    (tmp_path / "locked.mcap").chmod(0)
    reachable(tmp_path)
    before = ("identify", tmp_path / "open.mcap", "--out", tmp_path / "results")
    done = as_nobody("identify", tmp_path / "locked.mcap", once=before)
    assert (done.returncode, done.stdout) == (2, ""), done.stderr
    assert done.stderr.count("\n") == 1 and f"{tmp_path}/locked.mcap: no permission to read it" in done.stderr
