"""Reads vectors of a MAT file, in a child process (see child.py).

SciPy's reader can crash on a damaged file, or ask for any amount of memory: that ends only this process. A
place is a variable, or a field of structs, `log.motor.current` or `runs(2).t`; all of it where it is a
vector, one column or row where it is a matrix.
"""

import math
import re
from typing import Any

MEMORY, SECONDS = 3 << 30, 60
"""Ceilings of the process: bytes of addresses (SciPy itself takes 1 GB of them), and processor time."""
DAMAGED = "no MAT file that can be read, expected one up to version 7; a damaged file?"
_PART = re.compile(r"(?P<name>[^()]+)(?:\((?P<number>[0-9]{1,6})\))?")


class Refused(ValueError):
    """The kind of a variable that holds no numbers, and the expected one; `_child.py` passes its words on."""


def read(path: str, limit: int, places: list[dict[str, Any]]) -> tuple[list[int], list[Any]]:
    """Return the sizes of the vectors, and the vectors.

    Raises Refused for anything but vectors of numbers.
    """
    from scipy.io import loadmat, whosmat

    shapes = {name: (shape, kind) for name, shape, kind in whosmat(path)}
    for place in places:
        check(place, shapes, limit // len(places))
    roots = sorted({root(place) for place in places})
    variables = loadmat(path, variable_names=roots)
    vectors = [vector(place, variables).astype("<f8") for place in places]
    return [values.size for values in vectors], vectors


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
        raise Refused(
            f"variable {place['column']!r} has {size:.0f} values, expected fewer than {most}"
        )


def vector(place: dict[str, Any], variables: dict[str, Any]) -> Any:
    """Return the numbers of a place as a vector."""
    import numpy as np

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
                raise Refused(
                    f"column {place['column']!r}: {way} is not a struct, expected one with {part}"
                )
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
        raise Refused(
            f"{way} is an array of {value.size} structs, expected which: {way}(1), {way}(2), …"
        )
    return value.ravel()[0]


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
