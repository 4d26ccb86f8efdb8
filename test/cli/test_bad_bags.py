"""Bags that cannot be used: one line that says what is wrong and where, status 2, no files left behind."""

from __future__ import annotations

import json

import numpy as np
import pytest
from bad_input import assert_refused, change, rsea, without
from foreign import EPOCH, joint_state, write_foreign

from msg_adapters import write_record
from rsea_ros.cli.main import main


def test_a_missing_topic_is_refused_by_name(record, tmp_path, out):
    write_record(without(record, "command"), tmp_path / "bag")
    done = rsea("identify", tmp_path / "bag", "--out", out)
    assert_refused(done, tmp_path / "bag", "no message on /rsea/torque_command", "the bag holds /rsea/ft")


def test_a_truncated_mcap_is_read_up_to_its_last_chunk(record, tmp_path):
    write_record(record, tmp_path / "whole.mcap")
    data = (tmp_path / "whole.mcap").read_bytes()
    (tmp_path / "cut.mcap").write_bytes(data[: int(0.7 * len(data))])
    done = rsea("identify", tmp_path / "cut.mcap", "--out", tmp_path / "results")
    assert done.returncode == 0, done.stderr
    assert "cut off" in done.stdout


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_command_that_is_not_finite_is_refused(record, tmp_path, out, value):
    write_record(change(record, "command", 7, y=value), tmp_path / "bag")
    done = rsea("identify", tmp_path / "bag", "--out", out)
    words = f"/rsea/torque_command effort[7] is {value}", "expected a finite number"
    assert_refused(done, tmp_path / "bag", *words)


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


def test_a_bag_of_two_joints_needs_the_joint_to_be_named(tmp_path, out):
    """The command is for one joint and the states are of two."""
    two = joint_state(EPOCH, ["hip", "knee"], [0.0, 1.0], [0.0, 1.0], [0.0, 1.0])
    rows = [
        ("/rsea/torque_command", EPOCH, joint_state(EPOCH, effort=[1.0])),
        ("/rsea/joint_states", EPOCH, two),
    ]
    bag = write_foreign(tmp_path / "bag", rows)
    done = rsea("identify", bag, "--out", out)
    assert_refused(done, bag, "/rsea/joint_states: 2 joints (hip, knee), expected one; name it with --joint")
    assert_refused(rsea("identify", bag, "--out", out, "--joint", "ankle"), bag, "no joint 'ankle'")
