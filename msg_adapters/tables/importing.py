"""Measurements of real machines to records."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from msg_adapters.tables.clock import repaired
from msg_adapters.tables.files import read_columns
from msg_adapters.tables.import_map import ImportMap, Rows, Term
from rsea_ros.errors import ImportMapError
from rsea_ros.signals import Channel, FloatArray, Record

UNDATED = 1e8
"""Stamps below this (s, three years after 1970) have no date: the file's clock starts near zero."""
START_NS = 1_000_000_000
"""Where an undated record starts: a stamp of zero would mean `not set`."""


def import_record(path: str | Path, mapping: ImportMap) -> Record:
    """Read a measurement as its map says; the record's notes tell what was repaired.

    Raises ImportMapError with file, row, column, value and expectation.
    """
    table = read_columns(Path(path), mapping.columns(), mapping.delimiter)
    keep = _rows(path, table, mapping.where)
    stamps, note = _stamps(path, table, mapping)
    stamps = stamps[keep]
    start = float(stamps[0])
    t = stamps - start
    channels = {name: Channel(t, _values(table, terms)[keep]) for name, terms in mapping.channels.items()}
    epoch = round(start * 1e9) if start > UNDATED else START_NS
    notes = (f"imported from {Path(path).name}, {mapping.path.name}: {mapping.about}".rstrip(": "), note)
    return Record(channels, str(path), epoch, tuple(filter(None, notes)))


def summary(record: Record, mapping: ImportMap) -> list[str]:
    """Return what was imported, for a person to compare with what he knows of the machine."""
    lines = list(record.notes)
    for name, channel in record.channels.items():
        columns = " + ".join(f"{term.column} [{term.unit}]" for term in mapping.channels[name])
        low, high = channel.y.min(), channel.y.max()
        lines.append(f"{name}: {len(channel)} samples of {columns}, {low:.6g} to {high:.6g} in SI units")
    return lines


def _rows(path: str | Path, table: Mapping[str, FloatArray], where: Rows | None) -> npt.NDArray[np.bool_]:
    """Return which rows count."""
    count = len(next(iter(table.values())))
    if where is None:
        return np.ones(count, np.bool_)
    values = table[where.column]
    keep = np.ones(count, np.bool_)
    if where.start is not None:
        keep &= values >= where.start
    if where.stop is not None:
        keep &= values < where.stop
    if where.equals is not None:
        keep &= values == where.equals
    if np.count_nonzero(keep) < 2:
        spread = f"{where.column} goes from {values.min():g} to {values.max():g}"
        raise ImportMapError(f"{path}: fewer than two rows left by where ({spread})")
    return keep


def _stamps(path: str | Path, table: Mapping[str, FloatArray], mapping: ImportMap) -> tuple[FloatArray, str]:
    """Return the stamp of each row, s, increasing, and what was repaired."""
    if mapping.time is None:
        count = len(next(iter(table.values())))
        return np.arange(count) / float(mapping.rate or 1.0), ""
    t = _values(table, (mapping.time,))
    back = np.flatnonzero(np.diff(t) < 0)
    if back.size:
        at = back[0] + 1
        steps = f"{t[at]:.6f} s after {t[at - 1]:.6f} s"
        raise ImportMapError(f"{path}: {mapping.time.column} of row {at + 1} goes back ({steps})")
    if t[-1] == t[0]:
        raise ImportMapError(
            f"{path}: {mapping.time.column} is {t[0]:g} s in every row, expected a clock that runs"
        )
    return repaired(t)


def _values(table: Mapping[str, FloatArray], terms: Sequence[Term]) -> FloatArray:
    parts = [term.gain * table[term.column] + term.constant for term in terms]
    return np.asarray(np.sum(parts, axis=0), np.float64)
