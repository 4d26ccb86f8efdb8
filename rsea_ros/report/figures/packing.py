"""Long traces in few bytes: steps of 16 bits about a straight line, compressed; page.js takes them apart."""

from __future__ import annotations

import base64
import gzip
from typing import Any

import numpy as np

from rsea_ros.records.record import FloatArray

STEPS = 60_000
"""Of the whole range, at the least: 16 bits hold them."""
_LEVEL = 6


def pack(values: FloatArray, step: float = 0.0) -> dict[str, Any]:
    """Return values for a page: value k = first + slope·k + step·(whole number k).

    step: allowed rounding, in the unit of the values; 0: the resolution of 16 bits.
    Not-a-number becomes a gap.
    """
    values = np.asarray(values, dtype=float)
    first, slope = _line(values)
    off = values - (first + slope * np.arange(len(values)))
    known = np.isfinite(off)
    low, high = (float(off[known].min()), float(off[known].max())) if known.any() else (0.0, 0.0)
    step = max(step, (high - low) / STEPS) or 1.0
    whole = np.where(known, np.round((off - low) / step), 2.0**16 - 1.0).astype("<u2")
    planes = np.concatenate([whole & 0xFF, whole >> 8]).astype(np.uint8)
    data = base64.b64encode(gzip.compress(planes.tobytes(), _LEVEL, mtime=0)).decode("ascii")
    return {"first": first + low, "slope": slope, "step": step, "data": data}


def _line(values: FloatArray) -> tuple[float, float]:
    """Return start and slope of the line through the ends: stamps lie on it but for their jitter."""
    if len(values) < 2 or not np.isfinite(values[[0, -1]]).all():
        return 0.0, 0.0
    return float(values[0]), float(values[-1] - values[0]) / (len(values) - 1)
