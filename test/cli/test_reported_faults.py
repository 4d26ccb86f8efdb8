"""Every verb reports the damage in a bag and still returns its result."""

from __future__ import annotations

import json

import pytest

from msg_adapters import BagWriter, iterate
from rsea_ros.cli.main import main


@pytest.fixture(scope="module")
def bag(tmp_path_factory):
    """Return a bag with a gap of 40 wrenches and with fewer messages than its metadata count."""
    folder = tmp_path_factory.mktemp("told")
    assert main(["simulate", "paper_high_impedance", "--out", str(folder / "clean"), "--duration", "8"]) == 0
    wrenches = 0
    with BagWriter(folder / "bag") as writer:
        for topic, kind, log_time, raw in iterate(folder / "clean"):
            wrenches += topic == "/rsea/ft"
            if topic != "/rsea/ft" or not 900 <= wrenches < 940:
                writer.write(topic, kind, log_time, raw)
    metadata = (folder / "clean" / "metadata.yaml").read_text().replace("clean.mcap", "bag.mcap")
    (folder / "bag" / "metadata.yaml").write_text(metadata)
    return folder / "bag"


def _assert_told(faults):
    told = {(fault["kind"], fault["channel"]): fault for fault in faults}
    assert told["missing_messages", "/rsea/ft"]["size"] == 40
    assert told["dropped_samples", "ft"]["size"] == 40


def test_identify_reports_the_faults_of_a_bag(bag, tmp_path, capsys):
    assert main(["identify", str(bag), "--out", str(tmp_path / "out"), "--json"]) == 0
    _assert_told(json.loads(capsys.readouterr().out)["data"]["faults"])


def test_predict_reports_the_faults_of_a_bag(bag, capsys):
    assert main(["predict", "paper_high_impedance", str(bag)]) == 0
    _assert_told(json.loads(capsys.readouterr().out)["data"]["faults"])


def test_the_check_before_a_diagnosis_reports_the_faults_of_a_bag(bag):
    from msg_adapters import TopicMap
    from rsea_ros.checks.faults import check
    from rsea_ros.cli.diagnose import readable
    from rsea_ros.model.rig_file import load_rig
    from rsea_ros.report.json_values import fault_json

    checked = check(readable(str(bag), TopicMap()), load_rig("paper_high_impedance"))
    _assert_told([fault_json(fault) for fault in checked.faults])
