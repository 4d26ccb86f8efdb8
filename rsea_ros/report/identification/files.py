"""The files of an identification: all of them or none."""

from __future__ import annotations

from pathlib import Path

from rsea_ros.identification.result import Identification
from rsea_ros.model.rig_file import rig_text
from rsea_ros.outputs.new_files import Destination, NewFiles
from rsea_ros.report.file_names import IDENTIFICATION_JSON, MODEL, REPORT
from rsea_ros.report.identification.json import identification_json
from rsea_ros.report.identification.page import identification_report
from rsea_ros.report.json_values import json_text, with_provenance
from rsea_ros.report.provenance import Provenance


def write_results(
    identification: Identification, out: Destination | str | Path, provenance: Provenance | None = None
) -> Path:
    """Write identification.json, model.yaml and report.html, and return the report's path.

    Raises OutputError for a name that is taken, OSError where something cannot be written.
    """
    with NewFiles(out) as new:
        contents = with_provenance(identification_json(identification), provenance)
        new.write(IDENTIFICATION_JSON, json_text(contents))
        new.write(MODEL, rig_text(identification.rig))
        return new.write(REPORT, identification_report(identification, provenance))
