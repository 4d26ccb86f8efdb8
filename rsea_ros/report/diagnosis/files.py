"""The files of a diagnosis: all of them or none."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from rsea_ros.diagnosis.result import Diagnosis
from rsea_ros.model.rig_file import rig_text
from rsea_ros.outputs.new_files import Destination, NewFiles
from rsea_ros.records.record import Record
from rsea_ros.report.diagnosis.json import diagnosis_json
from rsea_ros.report.diagnosis.overlay_records import overlay_records
from rsea_ros.report.diagnosis.page import diagnosis_report
from rsea_ros.report.file_names import DIAGNOSIS_JSON, MODEL, OVERLAY, REPORT
from rsea_ros.report.json_values import json_text, with_provenance
from rsea_ros.report.provenance import Provenance

OverlayWriter = Callable[[Mapping[str, Record], Path], None]
"""Writes records by namespace into one bag file: msg_adapters.records.write_overlay."""


def write_diagnosis(
    diagnosis: Diagnosis,
    record: Record,
    out: Destination | str | Path,
    write: OverlayWriter,
    provenance: Provenance | None = None,
) -> Path:
    """Write diagnosis.json, model.yaml, overlay.mcap and report.html, and return the report's path.

    record: the first one diagnosed, as it was read. Raises OutputError for a name that is taken, OSError or
    BagError where something cannot be written.
    """
    with NewFiles(out) as new:
        new.write(DIAGNOSIS_JSON, json_text(with_provenance(diagnosis_json(diagnosis), provenance)))
        new.write(MODEL, rig_text(diagnosis.extended_rig))
        write(overlay_records(diagnosis, record), new.stage(OVERLAY))
        return new.write(REPORT, diagnosis_report(diagnosis, provenance))
