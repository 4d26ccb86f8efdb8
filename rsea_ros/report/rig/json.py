"""The rig of a result and the values that differ from it, for programs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from rsea_ros.identification.result import Remark
from rsea_ros.model.rig_file import RigChoice
from rsea_ros.report.json_values import finite
from rsea_ros.report.rig.words import split_off_rig


def rig_json(choice: RigChoice, remarks: Sequence[Remark]) -> dict[str, Any]:
    """Return how the rig was given, and each value that is far from it."""
    return {
        "rig_option": choice.option or None,
        "rig_is_default": choice.is_default,
        "off_rig": [_off(remark) for remark in split_off_rig(remarks)[0]],
    }


def _off(remark: Remark) -> dict[str, Any]:
    stated, fitted, low, high, spreads = map(finite, remark.values)
    (name,) = remark.names
    return {
        "name": name,
        "rig": stated,
        "fitted": fitted,
        "ci95": [low, high],
        "unit": remark.unit,
        "spreads": spreads,
    }
