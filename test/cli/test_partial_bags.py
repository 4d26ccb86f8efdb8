"""Bags of which a part is missing, held or left aside: every verb says so, and writes nothing into them."""

from __future__ import annotations

import json
import shutil

import numpy as np
import pytest

from msg_adapters import TopicMap, read_record, write_record
from rsea_ros.checks.faults import check
from rsea_ros.cli.diagnose import readable
from rsea_ros.cli.main import main
from rsea_ros.model.rig_file import load_rig
from rsea_ros.records.record import Channel

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


PARTS = {
    late_torque: {("partly_recorded", "ft")},
    second_file: {("unnamed_file", "other.mcap")},
    held_sensors: {("frozen_samples", n) for n in ("position", "velocity", "ft")},
    coarse_table: {("coarse_stamps", "run.csv")},
}


@pytest.mark.parametrize("make", PARTS, ids=lambda make: make.__name__)
def test_every_verb_says_what_is_missing(make, run, tmp_path, capsys):
    bag = tmp_path / "bag"
    make(bag, run[1])
    capsys.readouterr()
    assert main(["check", str(bag), "--json"]) == 0
    (checked,) = json.loads(capsys.readouterr().out)["records"]
    lights = {(f["kind"], f["channel"]) for f in checked["findings"] if f["light"] != "green"}
    assert lights >= PARTS[make]
    identify = ["identify", str(bag), "--out", str(tmp_path / "out"), "--json"]
    for words in (identify, ["predict", RIG, str(bag)]):
        assert main(words) == 0
        faults = json.loads(capsys.readouterr().out)["data"]["faults"]
        assert {(f["kind"], f["channel"]) for f in faults} >= PARTS[make], words[0]
    faults = check(readable(str(bag), TopicMap()), load_rig(RIG)).faults
    assert {(f.kind, f.channel) for f in faults} >= PARTS[make]
    assert len(faults) == len({(f.kind, f.channel) for f in faults}), "each once"


@pytest.mark.parametrize("inside", ["results", "deep/results"])
def test_results_are_not_written_into_the_bag(run, inside, refused):
    bag, _ = run
    for verb in ("identify", "diagnose"):
        assert "is the input" in refused(verb, bag, "--out", bag / inside)
    assert sorted(p.name for p in bag.iterdir()) == ["bag.mcap", "metadata.yaml"]


@pytest.mark.parametrize("shift", ["ft=100", "command=-100"])
def test_a_shift_out_of_the_run_is_refused(run, shift, refused):
    assert f"--shift {shift}: moves" in refused("check", run[0], f"--shift={shift}")
