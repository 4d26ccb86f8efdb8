"""The files of an identification: all of them or none."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rsea_ros.identification.result import Identification
from rsea_ros.model.rig_file import rig_text
from rsea_ros.new_files import NewFiles, Place
from rsea_ros.report.identification_json import identification_json
from rsea_ros.report.identification_page import identification_report

JSON, MODEL, REPORT = NAMES = ("identification.json", "model.yaml", "report.html")


def write_results(identification: Identification, out: Place | str | Path) -> Path:
    """Write identification.json, model.yaml and report.html, and return the report's path.

    Raises OutputError for a name that is taken, OSError where something cannot be written.
    """
    with NewFiles(out) as new:
        new.write(JSON, json_text(identification_json(identification)))
        new.write(MODEL, rig_text(identification.rig))
        return new.write(REPORT, identification_report(identification))


def json_text(contents: Mapping[str, Any]) -> str:
    """Return a result file for programs."""
    return json.dumps(contents, indent=1, allow_nan=False, ensure_ascii=False) + "\n"
