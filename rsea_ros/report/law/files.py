"""The files of a law: all of them or none."""

from __future__ import annotations

from pathlib import Path

from rsea_ros.effects.catalogue import lend
from rsea_ros.laws.law import LawResult
from rsea_ros.model.rig_file import rig_text
from rsea_ros.outputs.new_files import Destination, NewFiles
from rsea_ros.report.file_names import BASE, LAW_JSON, MODEL, REPORT
from rsea_ros.report.json_values import json_text, with_provenance
from rsea_ros.report.law.json import law_json
from rsea_ros.report.law.page import law_report
from rsea_ros.report.provenance import Provenance


def write_law(result: LawResult, out: Destination | str | Path, provenance: Provenance | None = None) -> Path:
    """Write law.json, the effect files, base.yaml, model.yaml and report.html; return the report's path."""
    with NewFiles(out) as new, lend(*(w.effect for w in result.laws)):
        new.write(LAW_JSON, json_text(with_provenance(law_json(result), provenance)))
        for written in result.laws:
            new.write(f"{written.law.name}.py", written.source)
        new.write(BASE, rig_text(result.base_rig))
        new.write(MODEL, rig_text(result.rig))
        return new.write(REPORT, law_report(result, provenance))
