"""Bags with bad samples, missing parts or damage: every verb says so, and still returns its result."""

import json
import os
import shutil
from types import SimpleNamespace

import mcap_damage_kinds as kinds
import numpy as np
import pytest
from bad_input import change, forked, rsea
from mcap_bytes import McapFile, write

from msg_adapters import TopicMap, iterate, read_record, write_record
from rsea_ros.checks.faults import check
from rsea_ros.cli.diagnose import readable
from rsea_ros.cli.main import main
from rsea_ros.model.rig_file import load_rig
from rsea_ros.records.record import Channel
from rsea_ros.report.result_files import fault_json


def test_identify_masks_and_reports_a_measurement_that_is_no_number(record, tmp_path):
    """It refused what diagnose and predict mask."""
    write_record(change(record, "ft", 7, y=1e31), tmp_path / "bag")
    done = rsea("identify", tmp_path / "bag", "--out", tmp_path / "results")
    assert (done.returncode, done.stderr) == (0, "")
    faults = json.loads((tmp_path / "results" / "identification.json").read_text())["data"]["faults"]
    assert ("nan", "ft") in {(fault["kind"], fault["channel"]) for fault in faults}


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


RIG = "paper_high_impedance"


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """Return the folder of a simulated run of 6 s, and its record."""
    bag = tmp_path_factory.mktemp("run") / "bag"
    assert main(["simulate", RIG, "--out", str(bag), "--duration", "6"]) == 0
    return bag, read_record(bag)


def late_torque(bag, record):
    ft = record["ft"]
    write_record(record.with_channels(ft=ft.between(3.0, 10.0)), bag)


def second_file(bag, record):
    write_record(record, bag)
    shutil.copy(bag / "bag.mcap", bag / "other.mcap")


def held_sensors(bag, record):
    held = {
        n: Channel(record[n].t, np.where(record[n].t > 3.0, record[n].y[840], record[n].y))
        for n in ("position", "velocity", "ft")
    }
    write_record(record.with_channels(**held), bag)


def coarse_table(bag, record):
    table, names = bag.with_name("run.csv"), ("command", "position", "velocity", "ft")
    rows = np.column_stack([np.floor(record["command"].t * 100.0) / 100.0, *(record[n].y for n in names)])
    np.savetxt(table, rows, delimiter=",", header=",".join(("t", *names)), comments="", fmt="%.9g")
    units = {"position": "rad", "velocity": "rad/s"}
    channels = "".join(f"  {n}: {{column: {n}, unit: {units.get(n, 'N m')}}}\n" for n in names)
    bag.with_name("map.yaml").write_text(f"time: {{column: t, unit: s}}\nchannels:\n{channels}")
    assert main(["import", str(table), "--map", str(bag.with_name("map.yaml")), "--out", str(bag)]) == 0


def damaged(damage):
    """Return a function that writes the run as an MCAP file with a damage of mcap_damage_kinds."""

    def make(bag, record):
        write_record(record, bag.with_name("clean.mcap"))
        read = iterate(bag.with_name("clean.mcap"))
        rows = [(topic, at, SimpleNamespace(__msgtype__=kind, raw=raw)) for topic, kind, at, raw in read]
        bare, chunked = (McapFile(rows, chunked, lambda k, row: row[2].raw) for chunked in (False, True))
        write(bag, damage(kinds.Run(bare, chunked)))

    return make


TOLD = {
    "late torque": (late_torque, {("partly_recorded", "ft")}),
    "second file": (second_file, {("unnamed_file", "other.mcap")}),
    "held sensors": (held_sensors, {("frozen_samples", n) for n in ("position", "velocity", "ft")}),
    "coarse table": (coarse_table, {("coarse_stamps", "run.csv")}),
    "lost messages": (damaged(kinds.lost_messages), {("missing_messages", "/rsea/ft")}),
}


@pytest.mark.parametrize("name", TOLD)
def test_every_verb_says_what_is_missing_or_damaged_and_the_intervals_hold(name, run, tmp_path, capsys):
    """Damaged bags gave intervals that missed the truth without a word; coarse stamps still do."""
    make, told = TOLD[name]
    bag, truth = tmp_path / ("bag.mcap" if make.__name__ == "make" else "bag"), load_rig(RIG)
    make(bag, run[1])
    capsys.readouterr()
    printed = []
    for words in (["check", bag], ["identify", bag, "--out", tmp_path / "out"], ["predict", RIG, bag]):
        assert main([*map(str, words), *["--json"] * (words[0] != "predict")]) == 0
        printed.append(json.loads(capsys.readouterr().out))
    (checked,), identified, predicted = printed[0]["records"], *printed[1:]
    assert {(f["kind"], f["channel"]) for f in checked["findings"] if f["light"] != "green"} >= told
    faults = [fault_json(fault) for fault in check(readable(str(bag), TopicMap()), truth).faults]
    assert identified["data"]["faults"] == predicted["data"]["faults"] == faults
    named = [(fault["kind"], fault["channel"]) for fault in faults]
    assert set(named) >= told and len(named) == len(set(named)), "each once"
    values = {n: v["ci95"] for n, v in identified["parameters"].items() if not n.startswith("clock")}
    assert name == "coarse table" or all(low <= truth[n] <= high for n, (low, high) in values.items())


@pytest.mark.parametrize("inside", ["results", "deep/results"])
def test_results_are_not_written_into_the_bag(run, inside, refused):
    bag, _ = run
    for verb in ("identify", "diagnose"):
        assert "is the input" in refused(verb, bag, "--out", bag / inside)
    assert sorted(p.name for p in bag.iterdir()) == ["bag.mcap", "metadata.yaml"]


@pytest.mark.parametrize("shift", ["ft=100", "command=-100"])
def test_a_shift_out_of_the_run_is_refused(run, shift, refused):
    assert f"--shift {shift}: moves" in refused("check", run[0], f"--shift={shift}")
