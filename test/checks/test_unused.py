"""A rig without a spring makes no use of some channels; that is said once, by every verb."""

from __future__ import annotations

import numpy as np
import pytest

import rsea_ros as rsea
from msg_adapters import write_record
from rsea_ros.checks.carried import with_check_faults
from rsea_ros.checks.check import check_record
from rsea_ros.cli.main import main
from rsea_ros.model.rig_file import load_rig
from rsea_ros.records.record import Channel

SENTENCE = "a rig without a spring makes no use of velocity, ft"


@pytest.fixture(scope="module")
def run():
    record = rsea.simulate("bare_drive", 15.0 * np.random.default_rng(4).standard_normal(1680), 280.0, seed=4)
    return record.with_channels(ft=Channel(record["command"].t, np.sin(record["command"].t)))


def test_the_check_and_the_record_of_a_fit_say_it(run):
    rig = load_rig("bare_drive")
    assert SENTENCE in check_record(run, rig).of("topics")[0].detail
    assert with_check_faults(run, rig, masks=False).notes == (SENTENCE,)
    assert check_record(run, load_rig("paper_high_impedance")).of("topics")[0].detail.count("no use") == 0


def test_identify_says_it_once(run, tmp_path, capsys):
    write_record(run, tmp_path / "bag")
    words = ["identify", str(tmp_path / "bag"), "--rig", "bare_drive", "--out", str(tmp_path / "out")]
    assert main(words) == 0
    assert capsys.readouterr().out.count(SENTENCE) == 1
