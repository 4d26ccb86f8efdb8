"""The files of a diagnosis: all written aside, then renamed, so that none is ever half there."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path

from rsea_ros.diagnosis.result import Diagnosis
from rsea_ros.model.rig_file import save_rig
from rsea_ros.report.diagnosis_json import diagnosis_json
from rsea_ros.report.diagnosis_overlay import overlay_records
from rsea_ros.report.diagnosis_page import diagnosis_report
from rsea_ros.report.results import write_json, write_text
from rsea_ros.signals import Record

OverlayWriter = Callable[[Mapping[str, Record], Path], None]
"""Writes records by namespace into one bag file: msg_adapters.overlay.write_overlay."""
JSON, MODEL, OVERLAY, REPORT = NAMES = ("diagnosis.json", "model.yaml", "overlay.mcap", "report.html")


def write_diagnosis(diagnosis: Diagnosis, record: Record, out_dir: str | Path, write: OverlayWriter) -> Path:
    """Write diagnosis.json, model.yaml, overlay.mcap and report.html, and return the report's path.

    record: the first one diagnosed, as it was read. Old files of these names stay until all new ones are
    complete. Raises OSError, RigError or BagError where something cannot be written.
    """
    out = Path(out_dir)
    out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=out, prefix="diagnosis-", suffix=".partial") as aside:
        place = Path(aside)
        write_json(place / JSON, diagnosis_json(diagnosis))
        save_rig(diagnosis.extended_rig, place / MODEL)
        write(overlay_records(diagnosis, record), place / OVERLAY)
        write_text(place / REPORT, diagnosis_report(diagnosis))
        for name in NAMES:
            (place / name).replace(out / name)
    return out / REPORT
