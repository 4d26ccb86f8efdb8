"""Reads columns of a Parquet file, in a child process (see child.py).

A damaged file can end only this process. One row group of one column is held at a
time. A place is a column, or a field of one, `pose.x`; `name[2]` the third number of its lists.
"""

from collections.abc import Iterator
from typing import Any

MEMORY, SECONDS = 4 << 30, 60
"""Ceilings of the process: bytes of addresses, and processor time."""

DAMAGED = "no Parquet file that can be read; a damaged file?"


class Refused(ValueError):
    """The kind of a column that holds no numbers, and the expected one; `_child.py` passes its words on."""


def read(path: str, limit: int, places: list[dict[str, Any]]) -> tuple[list[int], Iterator[Any]]:
    """Return the sizes of the columns, and their parts one by one.

    Raises Refused for other than numbers.
    """
    import pyarrow as pa
    from pyarrow.parquet import ParquetFile

    pa.set_cpu_count(1)
    file = ParquetFile(path)
    rows = file.metadata.num_rows
    if rows * len(places) > limit:
        raise Refused(f"{rows} rows of {len(places)} columns, expected fewer than {limit} numbers")
    if rows < 2:
        raise Refused(f"{rows} rows, expected a record")
    fields = [_field(place, file.schema_arrow) for place in places]
    ways = zip(places, fields, strict=True)
    parts = (part for place, (name, way) in ways for part in _vectors(file, name, way, place))
    return [rows] * len(places), parts


def _field(place: dict[str, Any], schema: Any) -> tuple[str, list[str]]:
    """Return the column of the file, and the way through its fields. Raises KeyError and Refused."""
    import pyarrow as pa

    base = place["base"]
    name = max((n for n in schema.names if base == n or base.startswith(f"{n}.")), key=len, default=None)
    if name is None or schema.names.count(name) > 1:
        raise KeyError(place["column"] if name is None else name, schema.names)
    way, kind = base[len(name) + 1 :].split(".") if base != name else [], schema.field(name).type
    for part in way:
        if not pa.types.is_struct(kind) or part not in [field.name for field in kind]:
            raise Refused(
                f"column {place['column']!r}: {name} is {kind}, expected a struct with {part}"
            )
        kind = kind.field(part).type
    _check_kind(place, kind)
    return name, way


def _check_kind(place: dict[str, Any], kind: Any) -> None:
    from pyarrow import types

    is_list = types.is_list(kind) or types.is_large_list(kind) or types.is_fixed_size_list(kind)
    element = kind.value_type if is_list else kind
    column = place["column"]
    if is_list and (place["index"] is None or place["is_row"]):
        raise Refused(f"column {column!r} is {kind}, expected one number of it: {place['base']}[0]")
    if not is_list and place["index"] is not None:
        raise Refused(f"column {column!r} is {kind}, expected lists of numbers")
    plain = (types.is_integer, types.is_floating, types.is_decimal, types.is_boolean, types.is_null)
    if not (_is_time(element) or any(is_so(element) for is_so in plain)):
        raise Refused(f"column {column!r} is {kind}, expected numbers")


def _is_time(kind: Any) -> bool:
    from pyarrow import types

    return bool(types.is_timestamp(kind) or types.is_duration(kind))


def _vectors(file: Any, name: str, way: list[str], place: dict[str, Any]) -> Iterator[Any]:
    """Yield the values of a column, a row group at a time."""
    import pyarrow as pa
    import pyarrow.compute as pc

    for group in range(file.num_row_groups):
        table = file.read_row_group(group, columns=[name], use_threads=False)
        for chunk in table.column(name).chunks:
            for part in way:
                chunk = pc.struct_field(chunk, part)
            if place["index"] is not None:
                try:
                    chunk = pc.list_element(chunk, place["index"])
                except (pa.ArrowInvalid, pa.ArrowIndexError):
                    least = pc.min(pc.list_value_length(chunk)).as_py()
                    raise Refused(
                        f"column {place['column']!r} has a list of {least} numbers, expected more than "
                        f"{place['index']}"
                    ) from None
            yield _doubles(chunk)


def _doubles(chunk: Any) -> Any:
    """Return numbers as doubles, stamps and durations in seconds; NaN where missing."""
    import numpy as np
    import pyarrow as pa

    factor = 1.0
    if _is_time(chunk.type):
        factor = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}[chunk.type.unit]
        chunk = chunk.cast(pa.int64())
    chunk = chunk.cast(pa.float64(), safe=False)
    return np.asarray(chunk.to_numpy(zero_copy_only=False), "<f8") * factor
