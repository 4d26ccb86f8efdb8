"""What a newcomer types, and what misled one: nearly right names, lists, a new rig, a forgotten one."""

import argparse
import functools
import importlib
import json
import shlex
from dataclasses import replace

import numpy as np
import pytest

import rsea_ros as rsea
from msg_adapters import write_record
from rsea_ros.checks.finding import Finding, Findings
from rsea_ros.cli import main as cli
from rsea_ros.cli.main import main
from rsea_ros.errors import OutputError, ParameterError
from rsea_ros.model.rig import Sensor
from rsea_ros.model.rig_file import load_rig, save_rig
from rsea_ros.outputs.files import NewFiles
from rsea_ros.records.record import Channel
from rsea_ros.report.check import check_lines


def test_a_table_given_for_a_bag_is_sent_to_import(tmp_path, refused):
    (tmp_path / "run.csv").write_text("t,u\n0,1\n")
    assert f"rsea import {tmp_path}/run.csv --map MAP" in refused("diagnose", tmp_path / "run.csv")


@pytest.mark.parametrize("words", ["identify x", "diagnose x", "export --mjcf x"])
def test_an_empty_name_is_no_folder(words, refused):
    """It was the working directory, where the results were written."""
    assert "'', expected a name" in refused(*words.split(), "--out", "")


@pytest.mark.parametrize("name", sorted(cli.verbs()))
def test_a_verbs_help_ends_with_an_example_that_its_parser_takes(name, capsys):
    with pytest.raises(SystemExit) as left:
        cli.main([name, "--help"])
    shown = capsys.readouterr().out
    verb = importlib.import_module(cli.verbs()[name])
    assert left.value.code == 0 and shown.rstrip().endswith(verb.EXAMPLE)
    for command in verb.EXAMPLE.split("&&"):
        program, subcommand, *arguments = shlex.split(command)
        assert (program, subcommand) == ("rsea", name)
        parser = argparse.ArgumentParser(exit_on_error=False)
        verb.add_arguments(parser)
        parser.parse_args(arguments) if name != "test" else None


def test_a_new_rig_is_valid_as_written_and_replaces_nothing(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert cli.main(["rig", "new", "left_knee"]) == 0
    assert load_rig("left_knee.yaml").name == "left_knee"
    assert cli.main(["rig", "new", "left_knee"]) == 2
    assert cli.main(["rig", "new", "left knee"]) == 2
    capsys.readouterr()
    assert cli.main(["rig", "check", "left_knee.yaml"]) == 0
    shown = capsys.readouterr().out
    assert "spring.stiffness" in shown and "N·m/rad" in shown and "identify fits: " in shown
    assert "read late" not in shown
    late = {**load_rig("left_knee.yaml").sensors, "ft": Sensor(delay=4e-3)}
    save_rig(replace(load_rig("left_knee.yaml"), sensors=late), "late.yaml")
    assert cli.main(["rig", "check", "late.yaml"]) == 0
    assert "read late: ft (4 ms)" in capsys.readouterr().out


def test_an_axis_with_a_minus_sign_is_accepted_as_typed(refused):
    assert "no such bag" in refused("check", "no_such_bag", "--axis", "-torque.z")


@pytest.mark.parametrize("target", ["folder", "nowhere"])
def test_a_folder_of_results_that_is_a_symbolic_link_is_named_as_such(target, tmp_path):
    """The user read "Too many levels of symbolic links", or of a dangling one "File exists"."""
    (tmp_path / "folder").mkdir()
    (tmp_path / "out").symlink_to(tmp_path / target)
    with pytest.raises(OutputError, match="out: is a symbolic link, expected a directory or a new name"):
        NewFiles(tmp_path / "out").__enter__()
    assert not list((tmp_path / "folder").iterdir()) and not (tmp_path / "nowhere").exists()


def test_what_a_check_says_of_a_file_with_a_long_name_keeps_its_column():
    """Its name of 70 characters left a column of 20 for the rest."""
    finding = Finding("amber", "coarse_stamps", "a_run_of_" * 8, detail="26592 of 31744 stamps repeat " * 4)
    (lines,) = check_lines(Findings("run", "rig", (finding,)))
    assert len(str(lines).splitlines()) <= 4


RIG = "paper_high_impedance"


@pytest.fixture(scope="module")
def record():
    return rsea.simulate(RIG, 15.0 * np.random.default_rng(4).standard_normal(2000), 280.0, seed=4)


def freeze(record):
    y = record["ft"].y.copy()
    y[600:1200] = y[600]
    return record.with_channels(ft=Channel(record["ft"].t, y))


def test_a_bag_given_twice_counts_once(record, tmp_path, refused):
    bag = tmp_path / "bag.mcap"
    write_record(record, bag)
    for verb in ("identify", "diagnose"):
        said = refused(verb, bag, bag, "--out", tmp_path / "out")
        assert f"{bag}: given twice, expected each bag once" in said
    with pytest.raises(ParameterError, match="given twice"):
        rsea.identify([record, record], RIG)


def test_diagnose_tells_of_a_command_that_never_changes(tmp_path, capsys):
    held = rsea.simulate(RIG, np.full(1680, 7.0), 280.0, seed=4)
    write_record(held, tmp_path / "bag.mcap")
    assert main(["diagnose", str(tmp_path / "bag.mcap"), "--out", str(tmp_path / "out")]) == 0
    assert "red: excitation commanded motor torque: 7.00 N·m, the command never changes" in (
        " ".join(capsys.readouterr().out.split())
    )


def clip(record):
    return record.with_channels(ft=Channel(record["ft"].t, np.clip(record["ft"].y, -4.0, 4.0)))


def test_identify_fits_no_sample_that_it_reports(record):
    fit = rsea.identify(clip(freeze(record)), RIG)
    assert {"frozen_samples", "clipping"} <= {fault.kind for fault in fit.result.faults}
    assert fit.result.verdict == "adequate"
    low, high = next(p.ci95 for p in fit.result.parameters if p.name == "spring.stiffness")
    assert low < rsea.load_rig(RIG)["spring.stiffness"] < high
    assert high - low < 2.0


def test_the_verdict_says_that_an_average_biases_the_values(record):
    """Of 20 fits none had the inertia and the stiffness within their intervals, and no line said so."""
    window = np.ones(9) / 9
    moved = ((n, record[n]) for n in ("position", "velocity"))
    averaged = {n: Channel(c.t, np.convolve(c.y, window, "same")) for n, c in moved}
    fit = rsea.identify(record.with_channels(**averaged), RIG)
    missed = [n for n, p in fit.parameters.items() if n[:5] != "clock" and not _holds(p.ci95, n)]
    assert missed
    assert "averaged before logging, which biases values beyond their intervals" in fit.summary()
    assert "biases" not in rsea.identify(record, RIG).summary()


def test_a_prediction_tells_of_a_turned_sign_and_of_a_zero_that_is_off(record, tmp_path, capsys):
    """A turned command was predicted at -100 % with no fault, an F/T sensor 300 N m off at -8780 %."""
    ft, torque = record["ft"], record["motor_torque"]
    bad = record.with_channels(ft=Channel(ft.t, ft.y + 300.0), motor_torque=Channel(torque.t, -torque.y))
    write_record(bad, tmp_path / "bag.mcap")
    assert main(["predict", RIG, str(tmp_path / "bag.mcap")]) == 0
    faults = json.loads(capsys.readouterr().out)["data"]["faults"]
    assert {("offset", "ft"), ("sign", "motor_torque")} == {(f["kind"], f["channel"]) for f in faults}


def _holds(interval, name):
    return interval[0] < rsea.load_rig(RIG)[name] < interval[1]


STATED = load_rig(RIG)["spring.stiffness"]
TRUE = 1.3 * STATED


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A bag of a bench with a spring 30 % stiffer than the default rig's, and the rig of that bench."""
    place = tmp_path_factory.mktemp("bench")
    bench = load_rig(RIG).with_values({"spring.stiffness": TRUE})
    command = 15.0 * np.random.default_rng(4).standard_normal(1400)
    write_record(rsea.simulate(bench, command, 280.0, seed=4), place / "run.mcap")
    save_rig(bench, place / "mine.yaml")
    return place


@pytest.fixture
def play(folder, monkeypatch, capsys):
    """A function that calls a verb and returns its status and what it printed."""

    def call(*words):
        monkeypatch.chdir(folder)
        status = main(list(words))
        return status, capsys.readouterr().out

    return call


def only(sentence):
    """Return text in one line."""
    return " ".join(sentence.split())


def test_diagnose_names_the_default_rig_and_asks_whether_it_is_right(folder, play):
    """It said "Nothing is wrong with the simulation" of a spring 30 % off, and named no rig."""
    status, printed = play("diagnose", "run.mcap", "--out", "why", "--fail-on", "off_rig")
    assert status == 1
    lines = printed.splitlines()
    assert "othing is wrong" not in printed
    assert only(printed).startswith("The structure of the simulation fits: ")
    assert "1 value differs from the rig" in only(" ".join(lines[:2]))
    assert f"rig         {RIG} (the default: no --rig was given)" in lines
    differs = "spring.stiffness differs from the rig: the rig states 1530 N·m/rad, the fit gives 19"
    assert differs in only(printed)
    assert "Is this the right rig? If not, name yours with --rig" in only(printed)
    assert f"            rsea identify run.mcap --rig {RIG}" in lines
    said = json.loads((folder / "why" / "diagnosis.json").read_text(encoding="utf-8"))
    assert (said["verdict"], said["rig"], said["rig_is_default"]) == ("nothing_wrong", RIG, True)
    (off,) = said["off_rig"]
    assert off["name"] == "spring.stiffness" and off["unit"] == "N m/rad"
    assert off["rig"] == pytest.approx(STATED) and off["ci95"][0] < TRUE < off["ci95"][1]
    assert off["spreads"] == pytest.approx(np.log(1.3) / 0.05, rel=0.01)
    assert "1 value differs from the rig" in said["sentence"] and "othing is wrong" not in said["sentence"]
    page = (folder / "why" / "report.html").read_text(encoding="utf-8")
    assert "Values that differ from the rig" in page and "the default: no --rig was given" in page


def test_identify_says_so_too_and_has_the_rig_with_the_fitted_values(play):
    status, printed = play("identify", "run.mcap", "--out", "fitted", "--fail-on", "off_rig")
    assert status == 1
    assert f"times the noise (default rig {RIG}); 1 value differs from the rig" in only(printed)
    assert "continue with --rig fitted/model.yaml" in only(printed)


ASKED = "are the stamps in s"


@functools.cache
def run_of(rig, unit, rate=280.0):
    size, n = 0.3 if rig == "pd_joint" else 10.0, min(int(5 * rate), 7_000)
    record = rsea.simulate(rig, size * np.random.default_rng(4).standard_normal(n), rate, seed=4)
    return record.with_channels(**{n: Channel(unit * c.t, c.y) for n, c in record.channels.items()})


@pytest.mark.parametrize(("rig", "unit"), [("emps", 1e6), ("pd_joint", 1e-3)])
def test_every_verb_asks_for_the_unit_in_one_line(rig, unit, tmp_path, refused, capsys):
    """Of a rigid drive µs asked for 149 GiB, ms were "a bug in rsea"; ks gave a prediction of nothing."""
    bag, out = str(tmp_path / "bag.mcap"), str(tmp_path / "out")
    write_record(run_of(rig, unit), bag)
    verbs = (["predict", rig, bag], *([v, bag, "--rig", rig, "--out", out] for v in ("identify", "diagnose")))
    for arguments in verbs:
        assert ASKED in refused(*arguments)
    assert main(["check", bag, "--rig", rig, "--json", "--fail-on", "red"]) == 1
    (record,) = json.loads(capsys.readouterr().out)["records"]
    assert ASKED in " ".join(f["remedy"] for f in record["findings"] if f["light"] == "red")
    assert not [f for f in record["findings"] if f["kind"] in ("clock_jump", "wrong_rig")]


def test_a_fast_logger_and_a_slow_one_are_not_asked():
    for rate in (5.0, 20000.0):
        said = " ".join(rsea.check(run_of("emps", 1.0, rate), "emps").summary().split())
        assert ASKED not in said
