"""Every verb reports the damage in a bag and still returns its result."""

from __future__ import annotations

import json
from types import SimpleNamespace

import mcap_damage_kinds as kinds
import pytest
from mcap_bytes import McapFile, write

from msg_adapters import TopicMap, iterate
from rsea_ros.checks.faults import check
from rsea_ros.cli.diagnose import readable
from rsea_ros.cli.main import main
from rsea_ros.model.rig_file import load_rig
from rsea_ros.report.result_files import fault_json

RIG = "paper_high_impedance"


DAMAGE = {
    "lost messages": (kinds.lost_messages, "missing_messages"),
    "flipped in a chunk": (kinds.flipped_in_chunk, "damaged_chunks"),
    "flipped number": (kinds.flipped_number, "checksum_mismatch"),
}


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """Return a simulated run of 5 s, ready to be damaged."""
    clean = tmp_path_factory.mktemp("clean") / "clean.mcap"
    assert main(["simulate", RIG, "--out", str(clean), "--duration", "5"]) == 0
    read = iterate(clean)
    rows = [(topic, at, SimpleNamespace(__msgtype__=kind, raw=raw)) for topic, kind, at, raw in read]
    bare, chunked = (McapFile(rows, chunked, lambda k, row: row[2].raw) for chunked in (False, True))
    return kinds.Run(bare, chunked)


@pytest.mark.parametrize("name", DAMAGE)
def test_verbs_report_damage_alike_and_the_intervals_hold(run, tmp_path, capsys, name):
    """Seven such bags gave intervals that missed the truth without a word."""
    damage, kind = DAMAGE[name]
    bag, truth = str(write(tmp_path / "a.mcap", damage(run))), load_rig(RIG)
    assert main(["identify", bag, "--out", str(tmp_path / "out"), "--json"]) == 0
    identified = json.loads(capsys.readouterr().out)
    assert main(["predict", RIG, bag]) == 0
    predicted = json.loads(capsys.readouterr().out)["data"]["faults"]
    diagnosed = [fault_json(fault) for fault in check(readable(bag, TopicMap()), truth).faults]
    assert identified["data"]["faults"] == predicted == diagnosed
    assert kind in {fault["kind"] for fault in predicted}
    values = {n: v["ci95"] for n, v in identified["parameters"].items() if not n.startswith("clock")}
    assert all(low <= truth[n] <= high for n, (low, high) in values.items())
