"""`rsea check`: a table, JSON, statuses, windows; and the same checks before identify and diagnose."""

from __future__ import annotations

import json

import numpy as np
import pytest
from independent.bench import drawn_bench, record_run

from msg_adapters import write_record
from rsea_ros.cli.main import main
from rsea_ros.records.record import Channel


@pytest.fixture(scope="module")
def good():
    return record_run(drawn_bench(np.random.default_rng(2)), 4, duration=8.0)


@pytest.fixture
def bag(good, tmp_path):
    def write(**channels):
        path = tmp_path / f"{'-'.join(channels) or 'good'}.mcap"
        write_record(good.with_channels(**channels), path)
        return str(path)

    return write


def dead(record):
    return Channel(record["ft"].t, np.zeros(len(record["ft"])))


def turn_ft(record):
    return Channel(record["ft"].t, -record["ft"].y)


def test_a_good_bag_is_green_and_says_its_rig(bag, capsys):
    assert main(["check", bag(), "--fail-on", "amber"]) == 0
    printed, errors = capsys.readouterr()
    assert errors == ""
    assert "red" not in printed.split("checked against")[0]
    assert "N·m" in printed and "N m" not in printed, "one spelling of a unit"
    assert "checked against default rig paper_high_impedance: 0 red, 0 amber" in printed


def test_several_bags_as_json_and_a_status(bag, good, capsys):
    assert main(["check", bag(), bag(ft=turn_ft(good)), "--json", "--fail-on", "red"]) == 1
    said = json.loads(capsys.readouterr().out)
    assert (said["schema"], said["rig"], said["light"]) == (1, "paper_high_impedance", "red")
    assert [record["light"] for record in said["records"]] == ["green", "red"]
    (sign,) = (f for f in said["records"][1]["findings"] if f["kind"] == "sign")
    assert sign["remedy"] == "--axis -torque.z"


def test_the_suggested_axis_corrects_the_bag(bag, good, capsys):
    assert main(["check", bag(ft=turn_ft(good)), "--axis=-torque.z", "--fail-on", "red"]) == 0


def test_for_a_dead_axis_the_one_that_follows_the_command_is_suggested(bag, capsys):
    assert main(["check", bag(), "--axis", "torque.x", "--fail-on", "red"]) == 1
    assert "--axis torque.z" in capsys.readouterr().out


@pytest.mark.parametrize("options", [["--from", "2", "--to", "7"], ["--window", "2:7"], ["--window=2:7"]])
def test_a_window_cuts_the_record(bag, options, capsys):
    assert main(["check", bag(), *options, "--json"]) == 0
    (record,) = json.loads(capsys.readouterr().out)["records"]
    assert record["light"] != "red"


@pytest.mark.parametrize("verb", [["check"], ["identify"], ["diagnose"], ["predict", "paper_high_impedance"]])
@pytest.mark.parametrize(
    ("options", "what"),
    [
        (["--window", "90:99"], "no sample"),
        (["--window", "5"], "expected A:B"),
        (["--from", "3", "--to", "2"], "a beginning before its end"),
        (["--from", "nan"], "a beginning before its end"),
    ],
)
def test_every_verb_refuses_a_senseless_window_in_one_line(bag, verb, options, what, capsys):
    assert main([*verb, bag(), *options]) == 2
    errors = capsys.readouterr().err
    assert what in errors and errors.count("\n") == 1


def test_identify_says_first_what_is_wrong_and_leaves_a_dead_channel_out(bag, good, tmp_path, capsys):
    out = tmp_path / "out"
    assert main(["identify", bag(ft=dead(good)), "--out", str(out)]) == 0
    printed = capsys.readouterr().out
    assert "F/T torque measures nothing; the model fits the rest: " in printed
    assert "dead channel in F/T torque" in printed and "next: " not in printed
    said = json.loads((out / "identification.json").read_text(encoding="utf-8"))
    assert {(f["kind"], f["channel"]) for f in said["data"]["faults"]} == {("dead_channel", "ft")}
    assert "ft" not in said["residual_rms"]
    assert (said["verdict"], said["next"]) == ("misfit", None)


def test_identify_questions_the_rig(bag, tmp_path, capsys):
    assert main(["identify", bag(), "--rig", "prototype_knee", "--out", str(tmp_path / "out")]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "compared with rig prototype_knee:"
    assert "is this the right rig?" in " ".join(" ".join(lines[1:4]).split())
