"""A program of its own: `_mat_child.py FILE LIMIT PLACES` writes vectors of a MAT file to its output.

SciPy's reader can crash on a damaged file, or ask for any amount of memory: that ends only this process (see
child.py). A place is a variable, or a field of structs, `log.motor.current` or `runs(2).t`; all of it where
it is a vector, one column or row where it is a matrix.
"""

from __future__ import annotations

import json
import re
import resource
import sys
import warnings
from typing import Any

MEMORY, SECONDS = 3 << 30, 60
"""Ceilings of this process: bytes of addresses (SciPy itself takes 1 GB of them), and processor time."""
_PART = re.compile(r"(?P<name>[^()]+)(?:\((?P<number>[0-9]{1,6})\))?")


class Refused(ValueError):
    """What a variable is, and what was expected."""


def main(path: str, limit: int, places: list[dict[str, Any]]) -> None:
    """Read and write. Raises Refused for what is no vector of numbers."""
    from scipy.io import loadmat, whosmat

    shapes = {name: (shape, kind) for name, shape, kind in whosmat(path)}
    for place in places:
        check(place, shapes, limit // len(places))
    roots = sorted({root(place) for place in places})
    variables = loadmat(path, variable_names=roots)
    vectors = [vector(place, variables).astype("<f8") for place in places]
    _answer({"sizes": [values.size for values in vectors]})
    for values in vectors:
        sys.stdout.buffer.write(values.tobytes())


def root(place: dict[str, Any]) -> str:
    """Return the variable of the file that a place is in."""
    return str(place["base"]).split(".")[0].split("(")[0]


def check(place: dict[str, Any], shapes: dict[str, Any], most: int) -> None:
    """Refuse a variable that is not in the file, is no array of numbers, or has more values than `most`."""
    import numpy as np

    name = root(place)
    if name not in shapes:
        raise KeyError(place["column"] if "." not in place["base"] else name, list(shapes))
    shape, kind = shapes[name]
    is_struct = "." in place["base"] and kind == "struct"
    size = np.prod(shape, dtype=float)
    if not is_struct:
        expected = kind not in ("cell", "struct", "object", "opaque", "char")
        _check_shape(place, shape, kind, is_number=expected)
    if size > most:
        raise Refused(f"variable {place['column']!r} has {size:.0f} values, expected fewer than {most}")


def vector(place: dict[str, Any], variables: dict[str, Any]) -> Any:
    """Return the numbers of a place as a vector."""
    import numpy as np

    values = np.asarray(_descended(place, variables))
    _check_shape(place, values.shape, values.dtype, is_number=values.dtype.kind in "iufb")
    if place["index"] is None:
        return values.ravel()
    return values[place["index"]] if place["is_row"] else values[:, place["index"]]


def _descended(place: dict[str, Any], variables: dict[str, Any]) -> Any:
    """Return what a path like `log.motor(2).current` leads to."""
    value: Any = None
    way = ""
    for at, part in enumerate(place["base"].split(".")):
        match = _PART.fullmatch(part)
        if match is None:
            raise Refused(f"column {place['column']!r}: {part!r} is no name, expected log.motor(2).t")
        if at:
            names = getattr(getattr(value, "dtype", None), "names", None)
            if names is None:
                raise Refused(f"column {place['column']!r}: {way} is no struct, expected one with {part}")
            if match["name"] not in names:
                raise KeyError(f"{way}.{match['name']}", [f"{way}.{name}" for name in names])
            value = _single(value, way)[match["name"]]
        else:
            value = variables[match["name"]]
        way = f"{way}.{part}" if at else part
        if match["number"] is not None:
            if not 1 <= int(match["number"]) <= value.size:
                raise Refused(f"{way} of {value.size}, expected a number from 1")
            value = value.ravel(order="F")[int(match["number"]) - 1 : int(match["number"])]
    return value


def _single(value: Any, way: str) -> Any:
    """Return the one struct of an array of them. Raises Refused for several."""
    if value.size != 1:
        raise Refused(f"{way} is an array of {value.size} structs, expected which: {way}(1), {way}(2), …")
    return value.ravel()[0]


def _check_shape(place: dict[str, Any], shape: Any, kind: object, *, is_number: bool) -> None:
    """Refuse what is no vector of numbers, or no matrix that has the column or row asked for."""
    index = place["index"]
    is_vector = max(shape, default=0) >= 2 and max(shape) == _product(shape)
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


def _product(shape: Any) -> float:
    result = 1.0
    for length in shape:
        result *= length
    return result


def _answer(answer: dict[str, object]) -> None:
    sys.stdout.buffer.write(json.dumps(answer).encode() + b"\n")


if __name__ == "__main__":
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    warnings.simplefilter("ignore")
    try:
        main(sys.argv[1], int(sys.argv[2]), json.loads(sys.argv[3]))
    except KeyError as error:
        _answer({"column": error.args[0], "names": error.args[-1]})
    except MemoryError:
        _answer({"error": f"asks for more than {MEMORY >> 30} GB of memory"})
    except Refused as error:
        _answer({"error": str(error)})
    except Exception:  # whatever a damaged file makes of the reader
        _answer({"error": "no MAT file that can be read, expected one up to version 7; a damaged file?"})
