"""A separate program: `_readers.py FORMAT FILE LIMIT PLACES` reads columns of a MAT or Parquet file.

It imports nothing of this package, so that it starts fast and may be killed at any moment: SciPy's reader can
crash on a damaged file, or ask for any amount of memory, and that ends only this one. See column_files.py.
"""

import json
import math
import os
import re
import resource
import sys
import warnings
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

SECONDS = 60
"""s of processor time at most."""
_PART = re.compile(r"(?P<name>[^()]+)(?:\((?P<number>[0-9]{1,6})\))?")


class Refused(ValueError):
    """The kind of a column that holds no numbers, and the expected one."""


def main(kind: str, path: str, limit: int, places: list[dict[str, Any]]) -> None:
    """Write sizes and numbers, or one line with the reason of a failure."""
    read, memory, damaged = READERS[kind]
    resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    warnings.simplefilter("ignore")
    try:
        sizes, vectors = read(path, limit, places)
        answer({"sizes": sizes})
        for vector in vectors:
            sys.stdout.buffer.write(vector.tobytes())
    except KeyError as error:
        answer({"column": error.args[0], "names": error.args[-1]})
    except MemoryError:
        answer({"error": f"asks for more than {memory >> 30} GB of memory"})
    except Refused as error:
        answer({"error": str(error)})
    except Exception:  # a damaged file may raise anything in the reader
        answer({"error": damaged})


def answer(words: dict[str, object]) -> None:
    """Write a line that replaces all earlier output."""
    sys.stdout.buffer.flush()
    os.ftruncate(1, 0)
    os.lseek(1, 0, os.SEEK_SET)
    sys.stdout.buffer.write(json.dumps(words).encode() + b"\n")


def read_mat(path: str, limit: int, places: list[dict[str, Any]]) -> tuple[list[int], Iterable[Any]]:
    """Return the sizes of the vectors, and the vectors. Raises Refused for anything but vectors of numbers.

    A place is a variable, or a field of structs, `log.motor.current` or `runs(2).t`; all of it where it is a
    vector, one column or row where it is a matrix.
    """
    from scipy.io import loadmat, whosmat

    shapes = {name: (shape, kind) for name, shape, kind in whosmat(path)}
    for place in places:
        _check(place, shapes, limit // len(places))
    roots = sorted({_root(place) for place in places})
    variables = loadmat(path, variable_names=roots)
    vectors = [_vector(place, variables).astype("<f8") for place in places]
    return [values.size for values in vectors], vectors


def _root(place: dict[str, Any]) -> str:
    """Return the variable of the file that a place is in."""
    return str(place["base"]).split(".")[0].split("(")[0]


def _check(place: dict[str, Any], shapes: dict[str, Any], most: int) -> None:
    """Refuse a variable that is not in the file, is no array of numbers, or has more values than `most`."""
    name = _root(place)
    if name not in shapes:
        raise KeyError(place["column"] if "." not in place["base"] else name, list(shapes))
    shape, kind = shapes[name]
    if "." not in place["base"] or kind != "struct":
        is_number = kind not in ("cell", "struct", "object", "opaque", "char")
        _check_shape(place, shape, kind, is_number=is_number)
    if (size := np.prod(shape, dtype=float)) > most:
        raise Refused(
            f"variable {place['column']!r} has {size:.0f} values, expected fewer than {most}"
        )


def _vector(place: dict[str, Any], variables: dict[str, Any]) -> Any:
    """Return the numbers of a place as a vector."""
    values = np.asarray(_descend(place, variables))
    _check_shape(place, values.shape, values.dtype, is_number=values.dtype.kind in "iufb")
    if place["index"] is None:
        return values.ravel()
    return values[place["index"]] if place["is_row"] else values[:, place["index"]]


def _descend(place: dict[str, Any], variables: dict[str, Any]) -> Any:
    """Return the value at a path like `log.motor(2).current`."""
    value: Any = None
    way = ""
    for at, part in enumerate(place["base"].split(".")):
        match = _PART.fullmatch(part)
        if match is None:
            raise Refused(f"column {place['column']!r}: {part!r} is no name, expected log.motor(2).t")
        if at:
            names = getattr(getattr(value, "dtype", None), "names", None)
            if names is None:
                raise Refused(f"column {place['column']!r}: {way} is not a struct, expected one with {part}")
            if match["name"] not in names:
                raise KeyError(f"{way}.{match['name']}", [f"{way}.{name}" for name in names])
            if value.size != 1:
                raise Refused(
                    f"{way} is an array of {value.size} structs, expected which: {way}(1), {way}(2), …"
                )
            value = value.ravel()[0][match["name"]]
        else:
            value = variables[match["name"]]
        way = f"{way}.{part}" if at else part
        if match["number"] is not None:
            if not 1 <= int(match["number"]) <= value.size:
                raise Refused(f"{way} of {value.size}, expected a number from 1")
            value = value.ravel(order="F")[int(match["number"]) - 1 : int(match["number"])]
    return value


def _check_shape(place: dict[str, Any], shape: Any, kind: object, *, is_number: bool) -> None:
    """Refuse anything but a vector of numbers or a matrix with the requested column or row."""
    index = place["index"]
    is_vector = max(shape, default=0) >= 2 and max(shape) == math.prod(shape)
    if index is None and is_number and is_vector:
        return
    if index is not None and is_number and len(shape) == 2:
        across, along = (shape[0], shape[1]) if place["is_row"] else (shape[1], shape[0])
        if index < across and along >= 2:
            return
    wanted = "a vector of numbers"
    if is_number and len(shape) == 2 and not is_vector:
        first, last = (f"{place['base'].split('[')[0]}(:,{n})" for n in (1, shape[1]))
        wanted += f" or a column of the matrix, {first} to {last}"
    raise Refused(f"variable {place['column']!r} is {kind} {tuple(shape)}, expected {wanted}")


def read_parquet(path: str, limit: int, places: list[dict[str, Any]]) -> tuple[list[int], Iterable[Any]]:
    """Return the sizes of the columns, and their parts one by one: one row group of one column is held.

    A place is a column, or a field of one, `pose.x`; `name[2]` the third number of its lists.
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
            raise Refused(f"column {place['column']!r}: {name} is {kind}, expected a struct with {part}")
        kind = kind.field(part).type
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
    return name, way


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
    import pyarrow as pa

    factor = 1.0
    if _is_time(chunk.type):
        factor = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}[chunk.type.unit]
        chunk = chunk.cast(pa.int64())
    chunk = chunk.cast(pa.float64(), safe=False)
    return np.asarray(chunk.to_numpy(zero_copy_only=False), "<f8") * factor


READERS = {
    "MAT": (read_mat, 3 << 30, "no MAT file that can be read, expected one up to version 7; a damaged file?"),
    "Parquet": (read_parquet, 4 << 30, "no Parquet file that can be read; a damaged file?"),
}
"""By format: its reader, ceiling of addresses in bytes (SciPy takes 1 GB), words for a damaged file."""

if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], int(sys.argv[3]), json.loads(sys.argv[4]))
