"""Verbs that write, with their results at hand: nothing is computed, only written."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

from msg_adapters import write_record
from rsea_ros.checks import carried as usable
from rsea_ros.checks.finding import Findings
from rsea_ros.cli import _checks, experiment, paper
from rsea_ros.control import study
from rsea_ros.design import spring_design, tolerance
from rsea_ros.diagnosis import diagnose
from rsea_ros.experiment import advice
from rsea_ros.experiment import run_shape as run_file
from rsea_ros.fleet import query as store_columns
from rsea_ros.identification import identify
from rsea_ros.laws import learn
from rsea_ros.model.rig_file import RigChoice
from rsea_ros.records.record import Record
from rsea_ros.report import result_files
from rsea_ros.report.control import page as control_page
from rsea_ros.report.control import tables as control_tables
from rsea_ros.report.design import page as design_page
from rsea_ros.report.design import tables as design_tables
from rsea_ros.report.diagnosis import files as diagnosis_files
from rsea_ros.report.experiment import page as experiment_page
from rsea_ros.report.experiment import words as experiment_words
from rsea_ros.report.fleet import page as fleet_page
from rsea_ros.report.identification import page as results
from rsea_ros.report.law import page as law_page
from rsea_ros.report.paper import page as paper_page

RIG = "paper_high_impedance"
MAP = "time: {column: t, unit: s}\nchannels:\n  command: {column: u, unit: N m}\n"
OLD, JSON = b"old", {"all": 1}


@dataclass(frozen=True)
class Result:
    """The interface of a result that the verbs use."""

    rig: None = None
    extended_rig: None = None
    rates: tuple[()] = ()
    verdict: str = ""
    feasible: bool = True
    faults: tuple[()] = ()
    remarks: tuple[()] = ()
    rig_choice: RigChoice = field(default_factory=RigChoice)
    base_rig: None = None
    laws: tuple[()] = ()
    at_floor: bool = False
    joints: tuple[str, ...] = ("knee",)
    command: tuple[()] = ()
    rate: float = 280.0
    excluded: Mapping[str, float] = field(default_factory=dict)

    @property
    def proposal(self) -> Result:
        """The run of an experiment."""
        return self


WRITERS = {
    "simulate": (["simulate", RIG, "--duration", "1", "--out", "out/new.mcap"], ["new.mcap"]),
    "simulate to a directory": (["simulate", RIG, "--duration", "1", "--out", "out/new"], ["new"]),
    "import": (["import", "run.csv", "--map", "map.yaml", "--out", "out/new.mcap"], ["new.mcap"]),
    "predict": (["predict", RIG, "run.mcap", "--out", "out/new.csv"], ["new.csv"]),
    "export": (["export", "--mjcf", RIG, "--no-play", "--out", "out/new.xml"], ["new.xml"]),
    "export of another kind": (["export", "--urdf", RIG, "--out", "out/new.urdf"], ["new.urdf"]),
    "rig": (["rig", "new", "arm", "--out", "out/new.yaml"], ["new.yaml"]),
    "fleet": (["fleet", "report", "store", "--out", "out"], ["index.html", "joint-knee.html"]),
    "law": (["law", "run.mcap", "--json", "--out", "out"], list(result_files.LAW)),
    "experiment": (
        ["experiment", RIG, "--limits", "torque=1", "--json", "--out", "out"], list(result_files.EXPERIMENT)
    ),
    "design": (["design", "--json", "--out", "out"], ["design.json", "report.html"]),
    "identify": (["identify", "run.mcap", "--json", "--out", "out"], list(result_files.IDENTIFICATION)),
    "diagnose": (["diagnose", "run.mcap", "--json", "--out", "out"], list(result_files.DIAGNOSIS)),
    "control": (["control", "--json", "--out", "out"], ["control.json", "report.html"]),
    "paper": (["paper", "--json", "--out", "out"], ["one.mcap", "paper.json", "report.html"]),
}


def prepare(record: Record, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Make a folder the working directory, with inputs, and give the verbs results that cost nothing."""
    write_record(record, folder / "run.mcap")
    (folder / "map.yaml").write_text(MAP)
    (folder / "run.csv").write_text("t,u\n0,1\n1,2\n2,3\n")
    monkeypatch.chdir(folder)
    result = Result()
    for module, names, value in (
        (identify, "identify", result), (diagnose, "diagnose", result), (study, "study", result),
        (spring_design, "spring_design", result), (spring_design, "least_stiffness", 1.0),
        (tolerance, "robust_stiffness", np.inf),
        (usable, "check_diagnosable", None), (_checks, "check_record", Findings("run.mcap", RIG, (), ())),
        (results, "identification_json", JSON), (results, "identification_report", "page"),
        (diagnosis_files, "diagnosis_json", JSON), (diagnosis_files, "diagnosis_report", "page"),
        (diagnosis_files, "overlay_records", {"/rsea": record}),
        (results, "rig_text", "rig"), (diagnosis_files, "rig_text", "rig"),
        (control_tables, "control_json", JSON), (control_page, "control_report", "page"),
        (design_tables, "design_json", JSON), (design_page, "design_report", "page"),
        (paper_page, "paper_json", JSON), (paper_page, "paper_report", "page"),
        (learn, "learn", result), (law_page, "law_json", JSON), (law_page, "law_report", "page"),
        (law_page, "rig_text", "rig"), (experiment, "_possible", ((), {}, {})), (advice, "advise", result),
        (run_file, "run_text", "t,u"), (experiment_words, "advice_json", JSON),
        (experiment_page, "advice_page", "page"), (store_columns, "history", {}),
        (store_columns, "recordings", {}),
        (fleet_page, "fleet_trends", result), (fleet_page, "alarms_of", []), (fleet_page, "_steps", None),
        (fleet_page, "joint_page", "page"), (fleet_page, "fleet_page", "page"),
    ):  # fmt: skip
        monkeypatch.setattr(module, names, lambda *words, value=value, **named: value)
    monkeypatch.setattr(paper, "_tests", lambda args, new, tell: write_record(record, new.stage("one.mcap")))


def contents(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() if p.is_file() else b"" for p in folder.rglob("*")}
