"""A program of its own: `_mat_child.py FILE LIMIT COLUMN…` writes the vectors of a MAT file to its output.

SciPy's reader can crash on a damaged file, or ask for any amount of memory: that ends only this process.
Output: a line of JSON, {"sizes": …} in the order of the columns or {"error": …}, then the numbers as doubles.
"""

from __future__ import annotations

import json
import resource
import sys
import warnings

MEMORY, SECONDS = 3 << 30, 60
"""Ceilings of this process: bytes of addresses (SciPy itself takes 1 GB of them), and processor time."""


class Refused(ValueError):
    """What a variable is, and what was expected."""


def main(path: str, limit: int, columns: list[str]) -> None:
    """Read and write. Raises Refused for what is no vector of numbers."""
    import numpy as np
    from scipy.io import loadmat, whosmat

    shapes = {name: (shape, kind) for name, shape, kind in whosmat(path)}
    for column in columns:
        if column not in shapes:
            raise KeyError(column, list(shapes))
        shape, kind = shapes[column]
        size = np.prod(shape, dtype=float)
        if (
            size != max(shape, default=0)
            or size < 2
            or kind in ("cell", "struct", "object", "opaque", "char")
        ):
            raise Refused(f"variable {column!r} is {kind} {shape}, expected a vector of numbers")
        if size * len(columns) > limit:
            raise Refused(f"variable {column!r} has {size:.0f} values, expected fewer than {limit}")
    variables = loadmat(path, variable_names=columns)
    vectors = []
    for column in columns:
        values = np.asarray(variables[column])
        if values.dtype.kind not in "iufb" or values.size < 2 or values.size != max(values.shape):
            raise Refused(
                f"variable {column!r} is {values.dtype} {values.shape}, expected a vector of numbers"
            )
        vectors.append(values.ravel().astype("<f8"))
    _answer({"sizes": [vector.size for vector in vectors]})
    for vector in vectors:
        sys.stdout.buffer.write(vector.tobytes())


def _answer(answer: dict[str, object]) -> None:
    sys.stdout.buffer.write(json.dumps(answer).encode() + b"\n")


if __name__ == "__main__":
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    warnings.simplefilter("ignore")
    try:
        main(sys.argv[1], int(sys.argv[2]), sys.argv[3:])
    except KeyError as error:
        _answer({"column": error.args[0], "names": error.args[-1]})
    except MemoryError:
        _answer({"error": f"asks for more than {MEMORY >> 30} GB of memory"})
    except Refused as error:
        _answer({"error": str(error)})
    except Exception:  # whatever a damaged file makes of the reader
        _answer({"error": "no MAT file that can be read, expected one up to version 7; a damaged file?"})
