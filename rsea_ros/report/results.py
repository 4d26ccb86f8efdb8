"""Result files in a directory, each written aside and then renamed, so that none is ever half there."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rsea_ros.identification.result import Identification
from rsea_ros.model.rig_file import save_rig
from rsea_ros.report.identification_json import identification_json
from rsea_ros.report.identification_page import identification_report


def write_results(identification: Identification, out_dir: str | Path) -> Path:
    """Write identification.json, model.yaml and report.html, and return the report's path."""
    out = Path(out_dir)
    out.mkdir(parents=True, exist_ok=True)
    write_json(out / "identification.json", identification_json(identification))
    save_rig(identification.rig, out / "model.yaml")
    return write_text(out / "report.html", identification_report(identification))


def write_json(path: Path, contents: Mapping[str, Any]) -> Path:
    """Write a result file for programs."""
    return write_text(path, json.dumps(contents, indent=1, allow_nan=False, ensure_ascii=False) + "\n")


def write_text(path: Path, text: str) -> Path:
    """Write a file aside and rename it; what was begun is removed when it cannot be finished."""
    aside = path.with_name(path.name + ".partial")
    try:
        aside.write_text(text, encoding="utf-8")
        os.replace(aside, path)
    except OSError as error:
        aside.unlink(missing_ok=True)
        error.filename = str(path)  # a failed write does not know it
        raise
    return path
