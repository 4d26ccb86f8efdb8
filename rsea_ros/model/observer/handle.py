"""Many arrays as one argument of a compiled function.

Numba unpacks every array of its arguments at every call from Python, 0.2 us each: for all of the filter's
it takes longer than the filter. So one array has their addresses and shapes, and compiled code rebuilds them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from llvmlite import ir
from numba import carray, types  # type: ignore[attr-defined]
from numba.extending import intrinsic

from rsea_ros.compiler import njit
from rsea_ros.model.observer.filter import FilterModel, FilterState, inner
from rsea_ros.model.observer.log import NONE, Log, take_in
from rsea_ros.model.step import Calls, Linear

ADDRESS, ROWS, COLUMNS = range(3)


def handle_of(model: FilterModel, state: FilterState, log: Log) -> npt.NDArray[np.int64]:
    """Return address and shape of every array, shape (arrays, 3). The arrays must outlive it."""
    return np.array([_row(array) for array in _arrays((model, state, log))], dtype=np.int64)


def _arrays(parts: Sequence[Any]) -> Iterator[Any]:
    for part in parts:
        if isinstance(part, tuple):
            yield from _arrays(part)
        elif isinstance(part, np.ndarray):
            yield part


def _row(array: npt.NDArray[Any]) -> tuple[int, int, int]:
    assert array.flags.c_contiguous and array.ndim <= 2
    return (array.ctypes.data, *(*array.shape, 1)[:2])


def _pointer(kind: Any) -> Any:
    """Return an intrinsic that takes an address for a pointer to numbers of a kind."""
    to: Any = types.CPointer(kind)  # type: ignore[no-untyped-call]

    @intrinsic
    def pointer(typingctx: Any, address: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> ir.Value:
            return builder.inttoptr(arguments[0], context.get_value_type(to))

        return to(types.intp), generate

    return pointer


_floats, _integers = _pointer(types.float64), _pointer(types.int64)


@inner
def _vector(h, i):  # type: ignore[no-untyped-def]
    return carray(_floats(h[i, ADDRESS]), (h[i, ROWS],))


@inner
def _matrix(h, i):  # type: ignore[no-untyped-def]
    return carray(_floats(h[i, ADDRESS]), (h[i, ROWS], h[i, COLUMNS]))


@inner
def _numbers(h, i):  # type: ignore[no-untyped-def]
    return carray(_integers(h[i, ADDRESS]), (h[i, ROWS],))


@inner
def _model(h, rest, reads_load, hold):  # type: ignore[no-untyped-def]
    m, v, n = _matrix, _vector, _numbers
    linear = Linear(m(h, 0), m(h, 1), n(h, 2), m(h, 3), m(h, 4), m(h, 5), v(h, 6), reads_load, rest)
    calls = Calls(n(h, 7), n(h, 8), n(h, 9), n(h, 10), v(h, 11), True)
    return FilterModel(linear, calls, m(h, 12), v(h, 13), m(h, 14), m(h, 15), v(h, 16), m(h, 17), m(h, 18),
                 m(h, 19), v(h, 20), m(h, 21), m(h, 22), v(h, 23), hold)  # fmt: skip


@inner
def _state(h):  # type: ignore[no-untyped-def]
    m, v = _matrix, _vector
    return FilterState(v(h, 24), v(h, 25), v(h, 26), m(h, 27), v(h, 28), v(h, 29), v(h, 30), v(h, 31),
                       v(h, 32), v(h, 33), v(h, 34))  # fmt: skip


@inner
def _log(h):  # type: ignore[no-untyped-def]
    m, v, n = _matrix, _vector, _numbers
    return Log(v(h, 35), n(h, 36), m(h, 37), m(h, 38), n(h, 39), v(h, 40))


@njit(cache=True, nogil=True, error_model="numpy")
def receive(handle, rest, reads_load, hold, t, kind, a, b, estimate):  # type: ignore[no-untyped-def]
    """Process an event; write the estimate of a measurement, shape (6,); return whether there is one."""
    model, state, log = _model(handle, rest, reads_load, hold), _state(handle), _log(handle)
    row = take_in(model, state, log, t, kind, a, b)
    if row == NONE:
        return False
    at = len(state.whole) - len(state.score) - len(state.clock) - len(state.estimate)
    for i in range(len(state.estimate)):
        estimate[i] = log.saved[row, at + i]
    return True
