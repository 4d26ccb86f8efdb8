"""What a newcomer types: names that are nearly right, requests for lists, a new rig."""

from __future__ import annotations

import argparse
import importlib
import shlex
from dataclasses import replace

import pytest

from rsea_ros.checks.finding import Finding, Findings
from rsea_ros.cli import main as cli
from rsea_ros.errors import OutputError
from rsea_ros.model.rig import Sensor
from rsea_ros.model.rig_file import load_rig, save_rig
from rsea_ros.outputs.files import NewFiles
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


@pytest.mark.parametrize("kind", ["dropped_samples", "checksum_mismatch"])
def test_a_long_kind_of_finding_is_apart_from_its_channel(kind):
    """`dropped samplesposition`."""
    findings = Findings("run", "bench", (Finding("amber", kind, "position", 1.0, "1"),))
    assert f"{kind.replace('_', ' ')} position" in next(check_lines(findings)).plain


def test_what_a_check_says_of_a_file_with_a_long_name_keeps_its_column():
    """Its name of 70 characters left a column of 20 for the rest."""
    finding = Finding("amber", "coarse_stamps", "a_run_of_" * 8, detail="26592 of 31744 stamps repeat " * 4)
    (lines,) = check_lines(Findings("run", "rig", (finding,)))
    assert len(str(lines).splitlines()) <= 4
