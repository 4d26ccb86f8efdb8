"""`rsea design` and `rsea paper` as a user runs them."""

from __future__ import annotations

import pytest

from rsea_ros.cli.main import main


@pytest.fixture
def directory(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_fail_on_makes_the_result_of_a_design_an_exit_status(directory):
    assert main(["design", "--fail-on", "unmet"]) == 1
    assert main(["design", "--fail-on", "unmet", "--stiffness", "4000"]) == 0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--stiffness", "0"], "stiffness = 0 N·m/rad, expected 1e-09 to 1e+06 N·m/rad"),
        (["--unit", "none"], "unit 'none', expected one of h54-200-s500-r, rd85x13-hd_cpl-25a-160"),
        (["--torque", "nan"], "torque = nan N·m, expected 1e-09 to 1e+06 N·m"),
        (
            ["--catalogue", "absent.yaml"],
            "absent.yaml: No such file or directory, expected a catalogue in YAML",
        ),
    ],
)
def test_bad_input_is_one_line_and_status_2(directory, capsys, arguments, message):
    assert main(["design", *arguments]) == 2
    assert capsys.readouterr().err == f"rsea design: {message}\n"
    assert not (directory / "out").exists()
