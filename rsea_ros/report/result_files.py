"""Files of results: their names, JSON from the fields of values, and where a result comes from.

Light, for verbs that look for names before they compute anything.
"""

from __future__ import annotations

import hashlib
import json
import math
import shlex
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass
from datetime import datetime, timezone
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rsea_ros.version import version

if TYPE_CHECKING:
    from rsea_ros.records.record import Fault

MODEL, REPORT = "model.yaml", "report.html"
CHECK_JSON, IDENTIFICATION_JSON = "check.json", "identification.json"
CHECK = (CHECK_JSON, REPORT)
IDENTIFICATION = (IDENTIFICATION_JSON, MODEL, REPORT)
DIAGNOSIS_JSON, OVERLAY = "diagnosis.json", "overlay.mcap"
DIAGNOSIS = (DIAGNOSIS_JSON, MODEL, REPORT, OVERLAY)
LAW_JSON, BASE = "law.json", "base.yaml"
LAW = (LAW_JSON, BASE, MODEL, REPORT)
EXPERIMENT_JSON, COMMANDS = "experiment.json", "run.csv"
EXPERIMENT = (COMMANDS, EXPERIMENT_JSON, REPORT)
DESIGN_JSON, CONTROL_JSON, PAPER_JSON = "design.json", "control.json", "paper.json"

_SHOWN = 12
"""Hexadecimal digits of a hash on a page; the result file has all of them."""


def pick(value: object, names: str = "") -> dict[str, Any]:
    """Return fields of a value for a result file: `pick(misfit, "what from=low to=high")`.

    names: fields, or key=field, with spaces between them; a.b is a field of a field. All fields by default.
    """
    pairs = [name.partition("=") for name in names.split() or [f.name for f in fields(value)]]  # type: ignore[arg-type]
    return {key: strict(attrgetter(of or key)(value)) for key, _, of in pairs}


def strict(value: Any) -> Any:
    """Return a value for JSON, dataclasses by their fields, at any depth; None for infinity and NaN."""
    if isinstance(value, Mapping):
        return {key: strict(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [strict(item) for item in value]
    if is_dataclass(value):
        return pick(value)
    if hasattr(value, "tolist"):
        return strict(value.tolist())
    return None if isinstance(value, float) and not math.isfinite(value) else value


def json_text(contents: Mapping[str, Any], provenance: Provenance | None = None) -> str:
    """Return a result file for programs, with where it comes from, where that is known."""
    origin = {"provenance": pick(provenance, "version date command sha256=files")} if provenance else {}
    return json.dumps({**contents, **origin}, indent=1, allow_nan=False, ensure_ascii=False) + "\n"


def fault_json(fault: Fault) -> dict[str, Any]:
    """Return a fault of the data for the result files."""
    more = ("" if fault.size is None else " size unit") + (" detail" if fault.detail else "")
    return pick(fault, f"kind channel share{more}")


@dataclass(frozen=True)
class Provenance:
    """date: ISO 8601, UTC. files: SHA-256 in hexadecimal by path, as they were given."""

    version: str
    date: str
    command: str
    files: Mapping[str, str] = field(default_factory=dict)

    @property
    def lines(self) -> tuple[str, ...]:
        """The footer of a page."""
        hashes = [f"{path} (SHA-256 {digest[:_SHOWN]}…)" for path, digest in self.files.items()]
        return f"rsea_ros {self.version}, {self.date}: {self.command}", *hashes


def provenance_of(command: Sequence[str], files: Iterable[str | Path]) -> Provenance:
    """Return the provenance of a result made now by a command line from some files or bags.

    Raises OSError for a file that cannot be read.
    """
    now = datetime.now(timezone.utc).isoformat(timespec="seconds")
    return Provenance(version(), now, shlex.join(command), {str(f): digest(f) for f in files})


def digest(path: str | Path) -> str:
    """Return the SHA-256 of a file; of a folder, that of its files in the order of their names."""
    path, whole = Path(path), hashlib.sha256()
    for part in sorted(p for p in path.iterdir() if p.is_file()) if path.is_dir() else [path]:
        with part.open("rb") as file:
            while block := file.read(1 << 20):
                whole.update(block)
    return whole.hexdigest()
