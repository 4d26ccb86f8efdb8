"""Alarms as files, one each, never twice: the store remembers reported alarms.

A file has the form that Prometheus' Alertmanager sends to a webhook, so that any such receiver accepts it.
"""

import hashlib
import json
import math
from contextlib import suppress
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

from rsea_extras.fleet.query import NoRowsError, history, recordings
from rsea_extras.fleet.store import Store
from rsea_extras.pages.words import sentence
from rsea_extras.trends import Alarm, alarms
from rsea_ros.extension.base import OutputError, make_folder, write_file

FOLDER = "alarms"


def write_alarms(store: Store) -> list[tuple[Path, str]]:
    """Write a file for each alarm that the store has not reported before; return it and the event in words.

    Two processes at once write each alarm once. Raises OSError where the store cannot be written.
    """
    folder = store.path / FOLDER
    make_folder(folder)
    try:
        present = alarms(history(store.path), recordings(store.path))
    except NoRowsError:
        return []
    written = []
    for alarm in present:
        file = folder / f"{alarm.joint}-{hashlib.sha256(alarm.key.encode()).hexdigest()[:12]}.json"
        with suppress(OutputError):
            write_file(file, json.dumps(webhook(alarm), indent=1, allow_nan=False, ensure_ascii=False) + "\n")
            written.append((file, said(alarm)))
    return written


def said(alarm: Alarm) -> str:
    """Return the event in a sentence, as the pages have it, after its joint."""
    return f"{alarm.joint}: {sentence(alarm)}"


def webhook(alarm: Alarm) -> dict[str, Any]:
    """Return an alarm as the body of a webhook, in the form of Alertmanager's (version 4)."""
    size = alarm.size
    labels = {"alertname": f"{alarm.kind} {alarm.about}", "joint": alarm.joint, "about": alarm.about,
              "kind": alarm.kind}  # fmt: skip
    annotations = {
        "summary": said(alarm),
        "unit": alarm.unit,
        "size": "" if size is None else f"{size.value:.6g}",
        "low": "" if size is None else f"{size.low:.6g}",
        "high": "" if size is None else f"{size.high:.6g}",
        "confidence": f"{alarm.confidence:.4g}",
        "earliest": _time(alarm.earliest_s),
        "latest": _time(alarm.latest_s),
        "recording": alarm.recording,
        "artefacts": alarm.artefacts,
    }
    one = {"status": "firing", "labels": labels, "annotations": annotations, "startsAt": _time(alarm.since_s),
           "fingerprint": alarm.key}  # fmt: skip
    return {"version": "4", "receiver": "rsea", "status": "firing", "groupKey": alarm.key, "alerts": [one],
            "commonLabels": labels, "commonAnnotations": annotations}  # fmt: skip


def _time(seconds: float) -> str:
    """Return a time as ISO 8601, empty where it is not known."""
    if not math.isfinite(seconds):
        return ""
    return datetime.fromtimestamp(seconds, timezone.utc).isoformat(timespec="seconds")
