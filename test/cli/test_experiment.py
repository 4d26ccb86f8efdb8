"""`rsea experiment`: a run that the excite node plays, or one line that says why there cannot be one."""

import json
from dataclasses import replace

import numpy as np
import pytest

from rsea_ros.cli.main import main
from rsea_ros.experiment.run_shape import read_run
from rsea_ros.experiment.stored_models import models_of
from rsea_ros.model.rig_file import load_rig, save_rig

RIG = load_rig("paper_high_impedance")


@pytest.fixture
def models(tmp_path):
    """Two models that a run separates."""
    paths = [tmp_path / "lag.yaml", tmp_path / "delay.yaml"]
    save_rig(RIG.with_effect("current_loop_lag", time_constant=3e-3), paths[0])
    save_rig(RIG.with_effect("command_delay", delay=3e-3), paths[1])
    return [str(p) for p in paths]


def test_the_run_keeps_its_limits_and_can_be_played(models, tmp_path, capsys):
    out = tmp_path / "out"
    words = ["--limits", "torque=5,slew=4000", "--longest", "0.5", "--refine", "0"]
    assert main(["experiment", *models, *words, "--out", str(out), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["run"]["separations"][0]["separation"] > 12.0 and not said["no_run_separates"]
    command, rate = read_run(out / "run.csv")
    assert rate == pytest.approx(280.0, rel=1e-6) and np.max(np.abs(command)) <= 5.0
    assert np.max(np.abs(np.diff(command))) * rate <= 4000.0 * (1.0 + 1e-6)
    assert "Causes that the run separates" in (out / "report.html").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--limits", "velocity=1"], "--limits: no torque"),
        (["--limits", "torque=5", "--longest", "0"], "expected a number > 0"),
        (["--limits", "torque=5", "--refine", "-3"], "expected a whole number >= 0"),
        (["--limits", "torque=5", "--shortest", "5", "--longest", "1"], "longest run 1 s, expected at least"),
        (["--limits", "torque=5", "--longest", "1e6"], "longest run 1e+06 s, expected at most 600 s"),
        (["--limits", "torque=5", "--rate", "5"], "rate = 5 Hz, expected 50 to 1000 Hz"),
        (["--limits", "torque=5", "--rate", "1e9"], "rate = 1e+09 Hz, expected 50 to 1000 Hz"),
    ],
)
def test_an_impossible_run_is_refused_in_one_line(models, words, message, refused):
    assert message in refused("experiment", *models, *words)


@pytest.mark.parametrize(
    ("other", "message"),
    [
        ("emps", "the motion is rotary in paper_high_impedance and linear in emps"),
        ("cycloidal", "the gear ratio is 502 in paper_high_impedance and 11 in cycloidal"),
        ("bare_drive", "the spring is compliant in paper_high_impedance and rigid in bare_drive"),
    ],
)
def test_models_of_different_machines_are_refused_in_one_line(models, other, message, tmp_path, refused):
    strange = tmp_path / "strange.yaml"
    rig = replace(load_rig(other), known=frozenset(), effects=())
    save_rig(rig.with_effect("torque_constant_error", gain=1.1), strange)
    line = refused("experiment", models[0], strange, "--limits", "torque=5")
    assert f"models of different machines: {message}, expected causes of one bench" in line


def test_a_diagnosis_file_supplies_the_doubtful_cause_and_its_alternatives():
    extended = RIG.with_effect("coulomb_friction", torque=1.0).with_effect("ft_gain_error", gain=1.1)
    interval = {"value": 1.1, "unit": "1", "ci95": [1.05, 1.15]}
    document = {
        "causes": [
            {"name": "coulomb_friction", "probability": 1.0, "parameters": {"torque": {"value": 1.0}}},
            {"name": "ft_gain_error", "probability": 0.6, "parameters": {"gain": interval}},
        ],
        "alternatives": [
            {
                "name": "torque_constant_error",
                "instead_of": "ft_gain_error",
                "probability": 0.4,
                "parameters": {"gain": interval},
            }
        ],
    }
    ours, other = models_of(document, extended)
    assert (ours.name, ours.probability) == ("ft_gain_error", 0.6)
    assert ours.intervals == {"ft_gain_error.gain": (1.05, 1.15)}
    assert [e.name for e in other.rig.effects] == ["coulomb_friction", "torque_constant_error"]


def cause(**body):
    """Return diagnosis.json with one cause."""
    return json.dumps({"causes": [{"name": "backlash", **body}]})


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (cause(name="unheard"), "effect 'unheard': not in the catalogue"),
        (cause(probability=-1), "causes[0].probability = -1, expected 0 to 1"),
        (cause(parameters={"gap": {"value": 1e-3, "ci95": [1]}}), "gap.ci95 = [1], expected [low, high]"),
        (cause(parameters={"gap": {"value": 1e-3, "ci95": 3}}), "gap.ci95 = 3, expected [low, high]"),
    ],
)
def test_a_wrong_diagnosis_file_is_refused_in_one_line_that_names_it(content, message, tmp_path, refused):
    save_rig(RIG, tmp_path / "model.yaml")
    path = tmp_path / "diagnosis.json"
    path.write_text(content, encoding="utf-8")
    line = refused("experiment", path, "--limits", "torque=5")
    assert f"{path}: " in line and message in line
