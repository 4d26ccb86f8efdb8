"""Names of the files of a result; light, for verbs that look for them before they compute anything."""

from __future__ import annotations

MODEL, REPORT = "model.yaml", "report.html"
IDENTIFICATION_JSON = "identification.json"
IDENTIFICATION = (IDENTIFICATION_JSON, MODEL, REPORT)
DIAGNOSIS_JSON, OVERLAY = "diagnosis.json", "overlay.mcap"
DIAGNOSIS = (DIAGNOSIS_JSON, MODEL, REPORT, OVERLAY)
LAW_JSON, BASE = "law.json", "base.yaml"
LAW = (LAW_JSON, BASE, MODEL, REPORT)
EXPERIMENT_JSON, COMMANDS = "experiment.json", "run.csv"
EXPERIMENT = (COMMANDS, EXPERIMENT_JSON, REPORT)
DESIGN_JSON, CONTROL_JSON, PAPER_JSON = "design.json", "control.json", "paper.json"
