"""Bags with bad samples are used without them; one that may not be read is refused in one line."""

from __future__ import annotations

import json
import os

import numpy as np
import pytest
from bad_input import change, forked, rsea

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


def test_a_file_without_read_permission_is_refused(record, tmp_path):
    """Played without root's rights."""
    bag = tmp_path / "locked.mcap"
    write_record(record, bag)
    bag.chmod(0)
    for folder in (tmp_path, *tmp_path.parents[:-2]):
        folder.chmod(0o755)
    told, tell = os.pipe()

    def play():
        os.geteuid() or os.seteuid(NOBODY)
        done = rsea("identify", bag)
        os.write(tell, json.dumps([done.returncode, done.stdout, done.stderr]).encode())

    assert forked(play) == 0
    status, printed, line = json.loads(os.read(told, 10_000))
    assert (status, printed) == (2, ""), line
    assert line.count("\n") == 1 and f"{bag}: no permission to read it" in line
