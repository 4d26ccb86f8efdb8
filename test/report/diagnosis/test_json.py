"""diagnosis.json by the contract, and the extended model beside it."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from rsea_ros.diagnosis.result import CauseParameter, Experiment
from rsea_ros.model.prediction_errors import predict
from rsea_ros.model.rig_file import load_rig
from rsea_ros.records.record import Fault
from rsea_ros.records.statistics import Z95
from rsea_ros.report.diagnosis.files import diagnosis_json
from rsea_ros.report.result_files import DIAGNOSIS


def strict(text: str) -> Any:
    """Return parsed JSON; NaN and Infinity, which JSON has not, are errors."""

    def refuse(constant: str) -> None:
        raise ValueError(constant)

    return json.loads(text, parse_constant=refuse)


def test_all_files_are_written_and_nothing_else(diagnosed) -> None:
    assert sorted(p.name for p in diagnosed.out.iterdir()) == sorted(DIAGNOSIS)
    assert (diagnosed.out / "report.html").stat().st_size < 8_000_000


def test_json_separates_the_noise_from_the_error_of_the_simulation(diagnosed) -> None:
    """The simulation's 0.25 % dominated nearly every interval, and neither file nor page said so."""
    (cause,) = strict((diagnosed.out / "diagnosis.json").read_text(encoding="utf-8"))["causes"]
    torque = cause["parameters"]["torque"]
    noise = torque["statistical_ci95"][1] - torque["value"]
    assert 0.0 < noise < torque["ci95"][1] - torque["value"]
    assert np.hypot(noise, Z95 * torque["model_sd"]) == pytest.approx(torque["ci95"][1] - torque["value"])
    assert "of which the simulation ±" in (diagnosed.out / "report.html").read_text(encoding="utf-8")


def test_not_a_number_is_written_as_null(diagnosed) -> None:
    unbounded = replace(
        diagnosed.diagnosis.causes[0],
        parameters={"torque": CauseParameter(3.0, "N m", (-np.inf, np.inf))},
        gain_holdout=np.nan,
    )
    odd = replace(
        diagnosed.diagnosis,
        causes=(unbounded,),
        noise_rms={"ft": np.nan},
        faults=(Fault("clock_jump", "ft", np.nan, "3.7 s"),),
        next_experiment=Experiment(
            "separates", "a", ("b",), excitation={"kind": "steps", "amplitude": np.inf}
        ),
    )
    document = strict(json.dumps(diagnosis_json(odd), allow_nan=False))
    assert document["causes"][0]["parameters"]["torque"]["ci95"] == [None, None]
    assert document["causes"][0]["gain"]["holdout"] is None
    assert document["baseline"]["noise_rms"]["ft"] is None
    assert document["data"]["faults"][0] == {
        "kind": "clock_jump", "channel": "ft", "share": None, "detail": "3.7 s"
    }  # fmt: skip
    assert document["next_experiment"]["excitation"] == {"kind": "steps", "amplitude": None}


def test_the_extended_model_predicts_what_the_nominal_one_does_not(diagnosed) -> None:
    extended = predict(load_rig(diagnosed.out / "model.yaml"), diagnosed.record)["ft"].rms_error
    nominal = predict(diagnosed.diagnosis.baseline_rig, diagnosed.record)["ft"].rms_error
    assert 1.0 - extended / nominal == pytest.approx(diagnosed.diagnosis.causes[0].gain_holdout, abs=0.05)
