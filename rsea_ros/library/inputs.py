"""Arguments of the library: one record or several."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rsea_ros.errors import ParameterError
from rsea_ros.records.record import MEASURED, Channel, Record


def records_of(data: Record | Sequence[Record]) -> list[Record]:
    """Return one or several records as a list. Raises ParameterError for anything else."""
    items: list[object] = [data] if isinstance(data, Record) else list(data)
    records = [item for item in items if isinstance(item, Record)]
    if len(records) < len(items):
        kind = next(type(item).__name__ for item in items if not isinstance(item, Record))
        raise ParameterError(f"data: {kind}, expected a Record (Record.from_arrays, rsea.read_bag)")
    if len({id(record) for record in records}) < len(records):
        raise ParameterError("data: a record is given twice, expected each record once")
    if not records:
        raise ParameterError("data: no record, expected one or more")
    return records


def without_missing(record: Record) -> Record:
    """Return a record without the samples that from_arrays holds as NaN: measurements that are missing."""
    channels = {name: channel for name, channel in record.channels.items() if name in MEASURED}
    missing = {name: np.isnan(channel.y) for name, channel in channels.items()}
    return record.with_channels(
        **{n: Channel(c.t[~missing[n]], c.y[~missing[n]]) for n, c in channels.items() if missing[n].any()}
    )
