"""The observer.

Numba unpacks every array of its arguments at every call from Python, 0.2 us each: for all of the filter's
it takes longer than the filter. So one array has their addresses and shapes, and compiled code rebuilds them.
"""

import math
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from llvmlite import ir
from numba import carray, types  # type: ignore[attr-defined]
from numba.extending import intrinsic

from rsea_ros.compiler import njit
from rsea_ros.errors import check_kind
from rsea_ros.model.observer import assemble as assembly, log as logs
from rsea_ros.model.observer.filter import LACK, SIGMA, FilterModel, FilterState, inner
from rsea_ros.model.observer.transition import transition
from rsea_ros.model.rig import Rig
from rsea_ros.model.step import Calls, Linear
from rsea_ros.records.record import HUGE, FloatArray, Record, is_measured

ADDRESS, ROWS, COLUMNS = range(3)


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
                 m(h, 19), m(h, 20), v(h, 21), m(h, 22), m(h, 23), v(h, 24), hold)  # fmt: skip


@inner
def _state(h):  # type: ignore[no-untyped-def]
    m, v = _matrix, _vector
    return FilterState(v(h, 25), v(h, 26), v(h, 27), m(h, 28), v(h, 29), v(h, 30), v(h, 31), v(h, 32),
                       v(h, 33), v(h, 34), v(h, 35), v(h, 36))  # fmt: skip


@inner
def _log(h):  # type: ignore[no-untyped-def]
    m, v, n = _matrix, _vector, _numbers
    return logs.Log(v(h, 37), n(h, 38), m(h, 39), m(h, 40), n(h, 41), v(h, 42))


@njit(cache=True, nogil=True, error_model="numpy")
def receive(handle, rest, reads_load, hold, t, kind, a, b, estimate):  # type: ignore[no-untyped-def]
    """Process an event; write the estimate of a measurement, shape (6,); return whether there is one."""
    model, state, log = _model(handle, rest, reads_load, hold), _state(handle), _log(handle)
    row = logs.take_in(model, state, log, t, kind, a, b)
    if row == logs.NONE:
        return False
    at = len(state.whole) - len(state.learnt) - len(state.score) - len(state.clock) - len(state.estimate)
    for i in range(len(state.estimate)):
        estimate[i] = log.saved[row, at + i]
    return True


GAP = 1.0
"""s. A larger jump of the stamps, in either direction, restarts the observer."""


class TorqueEstimate(NamedTuple):
    """Torques on the two ends and the disturbance on the gear, N m, and one sigma of each."""

    distal: float
    proximal: float
    disturbance: float
    sigma_distal: float
    sigma_proximal: float
    sigma_disturbance: float


class ErrorModel(NamedTuple):
    """Propagation of the sensor noise to T_d: e = A e + K v, error of T_d = c e, variances r of v.

    a: shape (n, n), k: (n, 2), r: (2,) of position (rad^2) and ft (N^2 m^2), c: (n,). sigma: of T_d, N m.
    """

    a: FloatArray
    k: FloatArray
    r: FloatArray
    c: FloatArray
    sigma: float


class Observer:
    """A Kalman filter on the unlumped model of a rig, one sample at a time. Stamps are s since any epoch.

    noise: of the sensors, by default from the rig. hold: time that a command stays in force, s. duration:
    of drifts to their full size, s. learns: whether noise and missing torque follow the innovations, or are
    as stated. Estimates are torques on both ends, N m, with one sigma.
    `observe` runs it over a record. Method: docs/observer.md.
    Not to be confused with the disturbance observer inside TorqueController.
    """

    _score: FloatArray
    _newest: float

    def __init__(self, rig: Rig, noise: assembly.Noise | None = None, *, hold: float = math.inf,
                 duration: float = 60.0, learns: bool = True) -> None:  # fmt: skip
        check_kind("rig", rig, Rig, "a Rig (rsea.load_rig)")
        self._rig, self._delay = assembly.without_delay(rig)
        self._noise = assembly.noise_of(rig) if noise is None else noise
        self._hold, self._duration, self._learns = hold, duration, learns
        self._estimate = np.zeros(2 * SIGMA)
        self.restarts = -1
        self._begin()

    def command(self, t: float, torque: float) -> None:
        """Add a command (N m) that takes effect at its stamp, which may be ahead of the measurements."""
        self._take(t, logs.COMMAND, torque, 0.0)

    def state(self, t: float, position: float, motor_torque: float = math.nan) -> TorqueEstimate | None:
        """Add position (rad) and motor torque (N m, nan if missing); return None for a sample too late."""
        return self._take(t, logs.STATE, position, motor_torque)

    def ft(self, t: float, torque: float) -> TorqueEstimate | None:
        """Add a torque of the F/T sensor (N m); return None for a sample that is too late."""
        return self._take(t, logs.FT, torque, 0.0)

    @property
    def late(self) -> int:
        """Number of late samples that were inserted at their stamps."""
        return int(self._log.place[logs.LATE])

    @property
    def refused(self) -> int:
        """Number of samples that came too late."""
        return int(self._log.place[logs.REFUSED])

    def consistency(self) -> dict[str, assembly.Consistency]:
        """Return for each channel the innovations since the last call over their expected size."""
        now = self.scores()
        change = now - self._score
        self._score = now
        return assembly.consistency(change)

    def scores(self) -> FloatArray:
        """Return the sums since the start of which `consistency` takes differences, shape (3, 3)."""
        return np.array(self._state.score.reshape(3, 3))

    def error_model(self, dt: float) -> ErrorModel:
        """Return the error dynamics at a period of dt s, with the present gain K = P h' / r."""
        m, p, size = self._model, self._state.p, len(self._state.p)
        f, q = np.empty((size, size)), np.empty((size, size))
        transition(m.a, m.walk, m.scale, dt, f, q)
        lack = float(self._state.learnt[LACK])
        k = p @ m.measured.T / (m.noise[:2] + np.array([0.0, lack]))
        a, c = (np.eye(size) - k @ m.measured) @ f, m.estimated[0]
        if lack > 0.0:  # then a part of the reading itself is in T_d: of its noise, one more state
            part = lack / (float(m.measured[1] @ p @ m.measured[1]) + lack + m.noise[1])
            a, k, c = np.pad(a, (0, 1)), np.vstack([k, [0.0, 1.0]]), np.append(c, part)
        heard = np.where(np.isfinite(m.noise[:2]), m.noise[:2], 0.0)
        return ErrorModel(a, k, heard, c, float(self._state.estimate[SIGMA]))

    def _begin(self) -> None:
        self._model, self._state = assembly.assemble(
            self._rig, self._noise, hold=self._hold, duration=self._duration, learns=self._learns
        )
        self._log = logs.empty_log(len(self._state.whole))
        arrays = _arrays((self._model, self._state, self._log))  # they must outlive the handle
        self._handle = np.array([_row(array) for array in arrays], dtype=np.int64)
        self._rest, self._reads_load = self._model.linear.rest, self._model.linear.reads_load
        self._score, self._newest = np.zeros((3, 3)), math.nan
        self.restarts += 1

    def _take(self, t: float, kind: int, a: float, b: float) -> TorqueEstimate | None:
        """Process an event. Values that are not measured (signals.is_measured) are left out, not believed."""
        if not math.isfinite(t) or (kind == logs.COMMAND and not is_measured(a, HUGE)):
            return None
        a, b = (value if is_measured(value, HUGE) else math.nan for value in (a, b))
        if abs(t - self._newest) > GAP:
            self._begin()
        if kind == logs.COMMAND:
            t += self._delay
        elif not t < self._newest:
            self._newest = t
        has_estimate = receive(
            self._handle, self._rest, self._reads_load, self._hold, t, kind, a, b, self._estimate
        )
        return TorqueEstimate._make(self._estimate.tolist()) if has_estimate else None


def observe(observer: Observer, record: Record) -> tuple[FloatArray, FloatArray]:
    """Run an observer over a record; return stamps and the estimates there.

    Stamps: those of the F/T samples, or of the positions if there is no sensor, s, shape (n,). Estimates:
    N m, shape (n, 6), in the order of Estimate.
    """
    check_kind("observer", observer, Observer, "an Observer")
    check_kind("record", record, Record, "a Record")
    wanted, t, rows = (logs.FT if "ft" in record else logs.STATE), [], []
    for stamp, kind, (a, b) in zip(*(each.tolist() for each in logs.events_of(record)), strict=True):
        if kind == logs.COMMAND:
            observer.command(stamp, a)
            continue
        estimate = observer.state(stamp, a, b) if kind == logs.STATE else observer.ft(stamp, a)
        if kind == wanted and estimate is not None:
            t.append(stamp)
            rows.append(estimate)
    return np.array(t), np.array(rows)
