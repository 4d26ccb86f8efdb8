"""What a newcomer types: names that are nearly right, requests for lists, a new rig."""

from __future__ import annotations

import argparse
import importlib
import shlex
from pathlib import Path

import pytest

from rsea_ros.checks.finding import Finding, Findings
from rsea_ros.cli import main as cli
from rsea_ros.effects.catalogue import catalogue
from rsea_ros.errors import OutputError
from rsea_ros.model.rig_file import load_rig, rig_names
from rsea_ros.outputs.new_files import NewFiles
from rsea_ros.report.check import check_lines


def test_a_table_given_for_a_bag_is_sent_to_import(tmp_path, capsys):
    (tmp_path / "run.csv").write_text("t,u\n0,1\n")
    assert cli.main(["diagnose", str(tmp_path / "run.csv")]) == 2
    assert f"rsea import {tmp_path}/run.csv --map MAP" in capsys.readouterr().err


@pytest.mark.parametrize("words", ["identify x", "diagnose x", "export --mjcf x", "watch"])
def test_an_empty_name_is_no_folder(words, capsys):
    """It was the working directory, where the results were written."""
    with pytest.raises(SystemExit) as end:
        cli.main([*words.split(), "--out", ""])
    assert end.value.code == 2 and "'', expected a name" in capsys.readouterr().err


def test_a_rig_file_with_a_mistyped_key_is_answered_too(tmp_path, capsys):
    (tmp_path / "mine.yaml").write_text("name: mine\nsprng: {rigid: true}\n")
    assert cli.main(["rig", "check", str(tmp_path / "mine.yaml")]) == 2
    assert "did you mean spring?" in capsys.readouterr().err


def test_the_version_is_that_of_the_package(capsys):
    assert cli.main(["--version"]) == 0
    assert capsys.readouterr().out.startswith("rsea_ros 0.")


@pytest.mark.parametrize("name", sorted(cli.verbs()))
def test_a_verbs_help_ends_with_an_example_that_its_parser_takes(name, capsys):
    with pytest.raises(SystemExit) as left:
        cli.main([name, "--help"])
    shown = capsys.readouterr().out
    verb = importlib.import_module(f"rsea_ros.cli.{cli.verbs()[name].stem}")
    assert left.value.code == 0 and shown.rstrip().endswith(verb.EXAMPLE)
    for command in verb.EXAMPLE.split("&&"):
        program, subcommand, *arguments = shlex.split(command)
        assert (program, subcommand) == ("rsea", name)
        parser = argparse.ArgumentParser(exit_on_error=False)
        verb.add_arguments(parser)
        parser.parse_args(arguments) if name != "test" else None


@pytest.mark.parametrize(("verb", "names"), [("rigs", rig_names()), ("effects", list(catalogue()))])
def test_every_rig_and_effect_is_listed(verb, names, capsys):
    assert cli.main([verb]) == 0
    first_words = [line.split()[0] for line in capsys.readouterr().out.splitlines() if line]
    assert set(names) <= set(first_words)


def test_every_import_map_is_listed(capsys):
    assert cli.main(["maps"]) == 0
    shown = capsys.readouterr().out
    maps = Path(cli.__file__).parents[2] / "config" / "imports"
    assert all(path.stem in shown for path in maps.glob("*.yaml"))


def test_an_effect_is_shown_with_equation_parameters_unit_and_source(capsys):
    assert cli.main(["effects", "backlash"]) == 0
    shown = capsys.readouterr().out
    assert "gap (rad): typical 0.004" in shown and "gap / 2" in shown and "Source: Nordin" in shown


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


def test_the_chassis_inertia_of_a_new_rig_is_a_guess_that_a_fit_may_change(tmp_path, monkeypatch):
    """A quarter of the true one and fixed, it left a backlash `leading` and a rest unexplained."""
    monkeypatch.chdir(tmp_path)
    assert cli.main(["rig", "new", "knee"]) == 0
    assert "chassis.inertia" in load_rig("knee.yaml").free()


def test_an_axis_with_a_minus_sign_is_accepted_as_typed(capsys):
    assert cli.main(["check", "no_such_bag", "--axis", "-torque.z"]) == 2
    assert "no such bag" in capsys.readouterr().err


def test_a_holdout_that_is_a_run_of_the_fit_is_refused(tmp_path, capsys):
    """Its gain was printed as held out."""
    run = str(tmp_path / "run.mcap")
    Path(run).touch()
    assert cli.main(["diagnose", run, "--holdout", f"{tmp_path}/../{tmp_path.name}/run.mcap"]) == 2
    assert "run.mcap: given twice, expected each bag once" in capsys.readouterr().err


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
    assert f"{kind.replace('_', ' ')} position" in check_lines(findings)[0].plain


def test_what_a_check_says_of_a_file_with_a_long_name_keeps_its_column():
    """Its name of 70 characters left a column of 20 for the rest."""
    finding = Finding("amber", "coarse_stamps", "a_run_of_" * 8, detail="26592 of 31744 stamps repeat " * 4)
    (lines,) = check_lines(Findings("run", "rig", (finding,)))
    assert len(str(lines).splitlines()) <= 4
