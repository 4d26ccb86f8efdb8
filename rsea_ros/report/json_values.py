"""Shared by result files: numbers that JSON can hold, faults of the data, provenance."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

from rsea_ros.records.record import Fault
from rsea_ros.report.provenance import Provenance


def with_provenance(contents: Mapping[str, Any], provenance: Provenance | None) -> dict[str, Any]:
    """Return the contents of a result file with where they come from, where that is known."""
    return {**contents, **({"provenance": provenance.json} if provenance else {})}


def json_text(contents: Mapping[str, Any]) -> str:
    """Return a result file for programs."""
    return json.dumps(contents, indent=1, allow_nan=False, ensure_ascii=False) + "\n"


def fault_json(fault: Fault) -> dict[str, Any]:
    """Return a fault of the data for the result files."""
    size = {} if fault.size is None else {"size": finite(fault.size), "unit": fault.unit}
    detail = {"detail": fault.detail} if fault.detail else {}
    return {"kind": fault.kind, "channel": fault.channel, "share": finite(fault.share), **size, **detail}


def numbers(values: Mapping[str, float | None]) -> dict[str, float | None]:
    """Return finite numbers by name, None for others."""
    return {name: None if value is None else finite(value) for name, value in values.items()}


def strict(value: Any) -> Any:
    """Return the values for JSON: None for each infinite number or NaN, at any depth."""
    if isinstance(value, Mapping):
        return {key: strict(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [strict(item) for item in value]
    return finite(value) if isinstance(value, float) else value


def finite(value: float) -> float | None:
    """Return a number as JSON can hold it: None when it is infinite or NaN."""
    return float(value) if math.isfinite(value) else None
