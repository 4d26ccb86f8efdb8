"""A store as columns: what reports and trends are made from."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from rsea_ros.fleet.query import connected
from rsea_ros.fleet.store import open_store

Columns = dict[str, npt.NDArray[Any]]
_HISTORY = """
SELECT joint, parameter, unit, epoch(time) AS time_s, value, low, high, identifiable, temperature, recording,
       artefacts
FROM parameters ORDER BY joint, parameter, time, recording
"""
_RECORDINGS = """
SELECT joint, recording, bag, epoch(time) AS time_s, duration, temperature, outcome, reason, verdict,
       diagnosis, residual, artefacts, seconds, peak_memory,
       [f.kind FOR f IN faults] AS faults, [c.name FOR c IN causes] AS causes
FROM recordings ORDER BY joint, time, recording
"""


def history(store: str | Path) -> Columns:
    """Return every parameter of every recording that is done, sorted by joint, parameter and time.

    Columns, shape (n,): joint, parameter, unit, recording, artefacts (text); time_s (s since 1970, NaN where
    unknown), value, low, high (in unit), temperature (°C, NaN where unknown); identifiable (bool).
    Raises FleetError for what is no store.
    """
    return _columns(store, _HISTORY)


def recordings(store: str | Path) -> Columns:
    """Return every recording with its outcome, sorted by joint and time.

    Columns, shape (n,): those of the row that are one value (text, float; time_s as in history); faults and
    causes as a list of names each. Raises FleetError for what is no store.
    """
    return _columns(store, _RECORDINGS)


def _columns(store: str | Path, query: str) -> Columns:
    with connected(open_store(store)) as database:
        found = database.execute(query).fetchnumpy()
    return {name: _plain(column) for name, column in found.items()}


def _plain(column: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Return a column without a mask: NaN, false or empty text where the store has no value."""
    if column.dtype.kind == "i":
        column = column.astype(np.float64)
    if isinstance(column, np.ma.MaskedArray):
        column = column.filled({"f": np.nan, "b": False}.get(column.dtype.kind, ""))
    return column
