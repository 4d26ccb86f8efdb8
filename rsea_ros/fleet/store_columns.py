"""A store as columns, for reports and trends."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from rsea_ros.fleet.query import connect, read_again
from rsea_ros.fleet.store import open_store

Columns = dict[str, npt.NDArray[Any]]
_HISTORY = """
SELECT joint, parameter, unit, epoch(time) AS time_s, value, low, high, identifiable, temperature, recording,
       artefacts
FROM parameters ORDER BY joint, parameter, time, recording
"""
_RECORDINGS = """
SELECT joint, recording, bag, epoch(time) AS time_s, duration, temperature, outcome, reason,
       CASE WHEN diagnosis = '' THEN verdict ELSE diagnosis END AS verdict, residual, artefacts, seconds,
       peak_memory::DOUBLE AS peak_memory, faults, causes
FROM recordings ORDER BY joint, time, recording
"""


def history(store: str | Path) -> Columns:
    """Return every parameter of every recording that is done, sorted by joint, parameter and time.

    Columns, shape (n,): joint, parameter, unit, recording, artefacts (text); time_s (s since 1970, NaN where
    unknown), value, low, high (in unit), temperature (°C, NaN where unknown); identifiable (bool).
    Raises FleetError for a folder that is not a store.
    """
    return _columns(store, _HISTORY)


def recordings(store: str | Path) -> Columns:
    """Return every recording with its outcome, sorted by joint and time.

    Columns, shape (n,): those of the row that are one value (text, float; time_s as in history; verdict: of
    the diagnosis where there is one); faults and causes: a list of dicts each, as in the row.
    Raises FleetError for a folder that is not a store.
    """
    return _columns(store, _RECORDINGS)


def _columns(store: str | Path, query: str) -> Columns:
    opened = open_store(store)

    def read() -> pa.Table:
        with connect(opened) as database:
            return database.sql(query).to_arrow_table()

    table = read_again(read)
    return {name: _plain(table[name].combine_chunks()) for name in table.column_names}


def _plain(column: pa.Array) -> npt.NDArray[Any]:
    """Return a column as numpy has it: NaN, false or empty text where the store has no value."""
    if pa.types.is_floating(column.type):
        return np.asarray(column.fill_null(np.nan), np.float64)
    if pa.types.is_boolean(column.type):
        return np.asarray(column.fill_null(False), np.bool_)
    values = np.empty(len(column), object)
    none: Any = "" if pa.types.is_string(column.type) else []
    values[:] = [none if value is None else value for value in column.to_pylist()]
    return values
