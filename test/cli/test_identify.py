"""simulate and identify as a person runs them one after another; test/golden has what they say."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from rsea_ros.cli.main import main
from rsea_ros.model.rig_file import load_rig

RIG = "paper_high_impedance"


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("simulated") / "run"
    assert main(["simulate", RIG, "--duration", "12", "--seed", "5", "--out", str(path)]) == 0
    return path


def test_identify_opens_with_whether_the_model_fits(bag, tmp_path, capsys):
    """Where the motor constant is off, the intervals know that it may be."""
    assert main(["identify", str(bag), "--out", str(tmp_path / "out"), "--fail-on", "misfit"]) == 0
    assert capsys.readouterr().out.startswith("The model fits: ")
    misfitting, effect = tmp_path / "misfitting", ["--effect", "torque_constant_error:gain=1.1"]
    assert main(["simulate", RIG, "--duration", "12", "--seed", "6", *effect, "--out", str(misfitting)]) == 0
    assert main(["identify", str(misfitting), "--out", str(tmp_path / "bad")]) == 0
    written = json.loads((tmp_path / "bad" / "identification.json").read_text(encoding="utf-8"))
    assert written["verdict"] == "misfit" and "torque_constant_error" in written["alternatives"]
    low, high = written["parameters"]["spring.stiffness"]["ci95"]
    assert low < load_rig(RIG)["spring.stiffness"] < high


def test_several_bags_make_one_result(bag, tmp_path, capsys):
    other = tmp_path / "other"
    assert main(["simulate", RIG, "--duration", "10", "--seed", "6", "--out", str(other)]) == 0
    assert main(["identify", str(bag), str(other), "--out", str(tmp_path / "both"), "--json"]) == 0
    data = json.loads(capsys.readouterr().out.partition("\n")[2])["data"]
    assert data["bags"] == [str(bag), str(other)]
    assert data["duration_s"] == pytest.approx(22.0, abs=0.1)
