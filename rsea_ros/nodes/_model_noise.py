"""The noise for the observer: measured by an identification, or stated by the rig."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rsea_ros.errors import ParameterError
from rsea_ros.model.extent import LARGEST
from rsea_ros.model.observer import Noise, noise_of
from rsea_ros.model.rig import Rig

_EXPECTED = "expected an identification.json of rsea identify"


def noise_from(rig: Rig, path: str) -> Noise:
    """Return the noise of a rig, measured where an identification.json is named.

    Raises ParameterError for a file of another kind.
    """
    if not path:
        return noise_of(rig)
    document = _document(path)
    return noise_of(rig, _numbers(document, "noise_rms", path), _numbers(document, "residual_rms", path))


def _document(path: str) -> Mapping[str, Any]:
    try:
        document = json.loads(Path(path).read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        why = error.strerror if isinstance(error, OSError) else "no JSON"
        raise ParameterError(f"parameter identification = {path!r}: {why}, {_EXPECTED}") from None
    if not isinstance(document, dict):
        raise ParameterError(f"parameter identification = {path!r}, {_EXPECTED}")
    return document


def _numbers(document: Mapping[str, Any], name: str, path: str) -> dict[str, float]:
    values = document.get(name)
    if not isinstance(values, dict):
        raise ParameterError(f"{path}: {name} = {values!r}, expected numbers by channel")
    numbers = {channel: v for channel, v in values.items() if isinstance(v, (int, float))}
    for channel, value in numbers.items():
        if not 0 <= value <= LARGEST:
            raise ParameterError(f"{path}: {name}.{channel} = {str(value)[:40]}, expected 0 to {LARGEST:g}")
    return {channel: float(value) for channel, value in numbers.items()}
