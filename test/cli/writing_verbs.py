"""Verbs that write, with their results at hand: nothing is computed, only written."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

from msg_adapters import write_record
from rsea_ros.checks import carried as usable, check as checks
from rsea_ros.checks.finding import Findings
from rsea_ros.design import spring_design
from rsea_ros.diagnosis import diagnose
from rsea_ros.identification import identify
from rsea_ros.model.rig_file import RigChoice
from rsea_ros.records.record import Record
from rsea_ros.report import design as design_page, identification as results, result_files
from rsea_ros.report.diagnosis import page as diagnosis_files

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


WRITERS = {
    "simulate": (["simulate", RIG, "--duration", "1", "--out", "out/new.mcap"], ["new.mcap"]),
    "simulate to a directory": (["simulate", RIG, "--duration", "1", "--out", "out/new"], ["new"]),
    "import": (["import", "run.csv", "--map", "map.yaml", "--out", "out/new.mcap"], ["new.mcap"]),
    "predict": (["predict", RIG, "run.mcap", "--out", "out/new.csv"], ["new.csv"]),
    "export": (["export", "--mjcf", RIG, "--no-play", "--out", "out/new.xml"], ["new.xml"]),
    "design": (["design", "--json", "--out", "out"], ["design.json", "report.html"]),
    "check": (["check", "run.mcap", "--json", "--out", "out"], list(result_files.CHECK)),
    "identify": (["identify", "run.mcap", "--json", "--out", "out"], list(result_files.IDENTIFICATION)),
    "diagnose": (["diagnose", "run.mcap", "--json", "--out", "out"], list(result_files.DIAGNOSIS)),
}


def prepare(record: Record, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Make a folder the working directory, with inputs, and give the verbs results that cost nothing."""
    write_record(record.between(0.0, 1.0), folder / "run.mcap")
    (folder / "map.yaml").write_text(MAP)
    (folder / "run.csv").write_text("t,u\n0,1\n1,2\n2,3\n")
    monkeypatch.chdir(folder)
    result = Result()
    for module, names, value in (
        (identify, "identify", result), (diagnose, "diagnose", result),
        (spring_design, "spring_design", result), (spring_design, "least_stiffness", 1.0),
        (spring_design, "robust_stiffness", np.inf),
        (usable, "check_diagnosable", None), (checks, "check_record", Findings("run.mcap", RIG, (), ())),
        (results, "identification_json", JSON), (results, "identification_report", "page"),
        (diagnosis_files, "diagnosis_json", JSON), (diagnosis_files, "diagnosis_report", "page"),
        (diagnosis_files, "overlay_records", {"/rsea": record}),
        (results, "rig_text", "rig"), (diagnosis_files, "rig_text", "rig"),
        (design_page, "design_json", JSON), (design_page, "design_report", "page"),
    ):  # fmt: skip
        monkeypatch.setattr(module, names, lambda *words, value=value, **named: value)


def contents(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() if p.is_file() else b"" for p in folder.rglob("*")}
