"""The findings of a check for programs (docs/check.md)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from rsea_ros.checks.finding import Finding, Findings, worst
from rsea_ros.report.json_values import fault_json, finite

SCHEMA = 1


def check_json(checks: Sequence[Findings]) -> dict[str, Any]:
    """Return the contents of the JSON of `rsea check`; infinite numbers and NaN are null."""
    return {
        "schema": SCHEMA,
        "rig": checks[0].rig_name,
        "rig_option": checks[0].rig_choice.option or None,
        "rig_is_default": checks[0].rig_choice.is_default,
        "light": worst([c.light for c in checks]),
        "records": [_record(c) for c in checks],
    }


def _record(c: Findings) -> dict[str, Any]:
    return {
        "bag": c.source,
        "light": c.light,
        "findings": [_finding(f) for f in c.findings],
        "faults": [fault_json(f) for f in c.faults],
    }


def _finding(f: Finding) -> dict[str, Any]:
    interval = None if f.low is None or f.high is None else [finite(f.low), finite(f.high)]
    return {
        "light": f.light,
        "kind": f.kind,
        "channel": f.channel,
        "value": None if f.value is None else finite(f.value),
        "unit": f.unit,
        "ci95": interval,
        "expected": f.expected,
        "detail": f.detail,
        "remedy": f.remedy,
    }
