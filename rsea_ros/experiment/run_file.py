"""The file of a designed run: t in s and command in N m, a line each, at an even rate."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from rsea_ros.errors import ParameterError
from rsea_ros.identification.excitation import FEWEST_SAMPLES
from rsea_ros.records.record import FloatArray

HEAD = "t,command"
_UNEVEN = 1e-3


def run_text(command: FloatArray, rate: float) -> str:
    """Return the text of a run. rate: Hz."""
    rows = (f"{k / rate:.9g},{float(value):.9g}" for k, value in enumerate(command))
    return "\n".join([HEAD, *rows, ""])


def read_run(path: str | Path) -> tuple[FloatArray, float]:
    """Return command (N m) and rate (Hz) of a run's file.

    Raises ParameterError for a file of another form, OSError for one that cannot be read.
    """
    lines = Path(path).read_text(encoding="utf-8").splitlines()
    if not lines or lines[0].strip() != HEAD:
        raise ParameterError(
            f"{path}: begins with {lines[0][:40] if lines else 'nothing'!r}, expected {HEAD}"
        )
    try:
        rows = np.array([[float(v) for v in line.split(",")] for line in lines[1:] if line.strip()])
    except ValueError as error:
        raise ParameterError(f"{path}: {error}, expected two numbers a line") from None
    if rows.ndim != 2 or rows.shape[1] != 2 or len(rows) < FEWEST_SAMPLES or not np.isfinite(rows).all():
        raise ParameterError(f"{path}: expected {FEWEST_SAMPLES} lines or more of two finite numbers")
    periods = np.diff(rows[:, 0])
    if not periods.min() > 0.0 or np.ptp(periods) > _UNEVEN * periods.mean():
        raise ParameterError(
            f"{path}: t rises by {periods.min():g} to {periods.max():g} s, expected an even rate"
        )
    return rows[:, 1], float(1.0 / periods.mean())
