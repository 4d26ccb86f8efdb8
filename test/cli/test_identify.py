"""simulate, identify and predict as a person runs them one after another."""

from __future__ import annotations

import csv
import json
import re
from pathlib import Path

import numpy as np
import pytest

from msg_adapters import read_record
from rsea_ros.cli.main import main
from rsea_ros.model.rig_file import load_rig

RIG = "paper_high_impedance"


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("simulated") / "run"
    assert main(["simulate", RIG, "--duration", "12", "--seed", "5", "--out", str(path)]) == 0
    return path


@pytest.fixture(scope="module")
def results(bag: Path) -> Path:
    out = bag.parent / "results"
    assert main(["identify", str(bag), "--out", str(out)]) == 0
    return out


def test_identify_opens_with_whether_the_model_fits(bag, tmp_path, capsys):
    """The verdict comes first on the terminal, and --fail-on makes it an exit status."""
    arguments = ["identify", str(bag), "--out", str(tmp_path / "out"), "--fail-on", "misfit"]
    assert main(arguments) == 0
    assert re.match(
        r"The model fits: .* times the noise \(default rig paper_high_impedance\)\n", capsys.readouterr().out
    )
    misfitting = tmp_path / "misfitting"
    effect = ["--effect", "torque_constant_error:gain=1.1"]
    assert main(["simulate", RIG, "--duration", "12", "--seed", "6", *effect, "--out", str(misfitting)]) == 0
    capsys.readouterr()
    arguments = ["identify", str(misfitting), "--out", str(tmp_path / "bad")]
    assert main(arguments) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("The model does not fit: F/T torque ")
    assert f"next: rsea diagnose {misfitting} --rig paper_high_impedance" in lines
    written = json.loads((tmp_path / "bad" / "identification.json").read_text(encoding="utf-8"))
    assert written["verdict"] == "misfit"
    assert written["times_noise"]["ft"] > 5.0
    assert "torque_constant_error" in written["alternatives"]
    low, high = written["parameters"]["spring.stiffness"]["ci95"]
    assert low < load_rig(RIG)["spring.stiffness"] < high, (
        "the interval knows that the motor constant may be off"
    )
    assert main([*arguments, "--out", str(tmp_path / "again"), "--fail-on", "misfit"]) == 1


def test_predict_leaves_only_noise_and_writes_every_channel(bag, results, tmp_path, capsys):
    table = tmp_path / "predicted.csv"
    assert main(["predict", str(results / "model.yaml"), str(bag), "--out", str(table)]) == 0
    channels = json.loads(capsys.readouterr().out)["channels"]
    assert channels["ft"]["rms_error"] == pytest.approx(0.03, rel=0.05)
    assert channels["ft"]["fit_percent"] > 99.0
    rows = list(csv.reader(table.read_text(encoding="utf-8").splitlines()))
    record = read_record(bag)
    assert rows[0] == ["t", *channels]
    assert len(rows) - 1 == len(record["ft"])
    values = np.array(rows[1:], float)
    error = values[:, 1 + list(channels).index("ft")] - record["ft"].y
    assert float(np.std(error)) == pytest.approx(channels["ft"]["rms_error"], rel=0.05)


def test_several_bags_make_one_result(bag, tmp_path, capsys):
    other = tmp_path / "other"
    assert main(["simulate", RIG, "--duration", "10", "--seed", "6", "--out", str(other)]) == 0
    assert main(["identify", str(bag), str(other), "--out", str(tmp_path / "both"), "--json"]) == 0
    data = json.loads(capsys.readouterr().out.partition("\n")[2])["data"]
    assert data["bags"] == [str(bag), str(other)]
    assert data["duration_s"] == pytest.approx(22.0, abs=0.1)
