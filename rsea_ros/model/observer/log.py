"""The observer over a log, and over a batch of models.

After a late sample the filter returns to the checkpoint before its stamp and repeats the later events. At one
instant measurements come before commands: a command with the stamp of a measurement acts after it.

The events are in order, so there is no log of checkpoints as `Observer` keeps one (log.py), and nothing is
said of the torques' doubt.
"""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from rsea_ros.compiler import njit
from rsea_ros.model.observer import filter as kf
from rsea_ros.model.observer.assemble import Noise, assemble, without_delay
from rsea_ros.model.rig import Rig
from rsea_ros.records.record import FloatArray, IntArray, Record

STATE, FT, COMMAND = range(3)
"""Kinds: position and motor torque; ft; command."""
FIRST, COUNT, DONE, LATE, REFUSED = range(5)
NONE = -1
LENGTH = 512


class Log(NamedTuple):
    """A ring: t (s), kind and two values of each event, and the state behind it.

    place: first row, number of events, how many are worked off, how many came late, too late; horizon: newest
    measurement, s.
    """

    t: FloatArray
    kind: npt.NDArray[np.int64]
    values: FloatArray
    saved: FloatArray
    place: npt.NDArray[np.int64]
    horizon: FloatArray


def empty_log(size: int) -> Log:
    """Return a log for states of some size."""
    return Log(
        t=np.zeros(LENGTH),
        kind=np.zeros(LENGTH, dtype=np.int64),
        values=np.zeros((LENGTH, 2)),
        saved=np.zeros((LENGTH, size)),
        place=np.zeros(REFUSED + 1, dtype=np.int64),
        horizon=np.full(1, -np.inf),
    )


@kf.inner
def _row(log, i):  # type: ignore[no-untyped-def]
    return (log.place[FIRST] + i) % LENGTH


@kf.inner
def _copy(a, out):  # type: ignore[no-untyped-def]
    for i in range(len(a)):
        out[i] = a[i]


@kf.inner
def _insert(log, t, kind, a, b):  # type: ignore[no-untyped-def]
    """Put an event in its place and return that, or NONE where no checkpoint goes back so far."""
    place = log.place
    if place[COUNT] == LENGTH:
        place[FIRST], place[COUNT] = (place[FIRST] + 1) % LENGTH, LENGTH - 1
        place[DONE] = max(place[DONE] - 1, 0)
    at = place[COUNT]
    while at > 0:
        before = _row(log, at - 1)
        if log.t[before] < t or (log.t[before] == t and log.kind[before] <= kind):
            break
        at -= 1
    if at == 0 and place[DONE] > 0:
        return NONE
    for i in range(place[COUNT], at, -1):
        new, old = _row(log, i), _row(log, i - 1)
        log.t[new], log.kind[new] = log.t[old], log.kind[old]
        log.values[new, 0], log.values[new, 1] = log.values[old, 0], log.values[old, 1]
    row = _row(log, at)
    log.t[row], log.kind[row], log.values[row, 0], log.values[row, 1] = t, kind, a, b
    place[COUNT] += 1
    return at


@kf.once
def _apply(model, state, kind, t, values):  # type: ignore[no-untyped-def]
    if state.clock[kf.STARTED] == 0.0:
        state.clock[kf.STARTED], state.clock[kf.NOW] = 1.0, t
    kf.predict(model, state, t)
    if kind == COMMAND:
        state.clock[kf.FORCED], state.clock[kf.SINCE] = values[0], t
    else:
        if kind == STATE:
            kf.weigh_torque(model, state, values[1])
        kf.update(model, state, kf.POSITION if kind == STATE else kf.WRENCH, values[0])
    kf.doubt(model, state)


@kf.once
def take_in(model, state, log, t, kind, a, b):  # type: ignore[no-untyped-def]
    """Add an event, process all up to the newest measurement, and return its row, or NONE."""
    at = _insert(log, t, kind, a, b)
    if at == NONE:
        log.place[REFUSED] += 1
        return NONE
    if at < log.place[DONE]:
        _copy(log.saved[_row(log, at - 1)], state.whole)
        log.place[DONE] = at
        log.place[LATE] += 1
    if kind != COMMAND:
        log.horizon[0] = max(log.horizon[0], t)
    while log.place[DONE] < log.place[COUNT]:
        row = _row(log, log.place[DONE])
        if log.t[row] > log.horizon[0] or (log.kind[row] == COMMAND and log.t[row] == log.horizon[0]):
            break
        _apply(model, state, log.kind[row], log.t[row], log.values[row])
        _copy(state.whole, log.saved[row])
        log.place[DONE] += 1
    return NONE if kind == COMMAND else _row(log, at)


MEASURED, TORQUE = range(2)
"""Columns of innovations: position or ft, whichever the event brings; motor torque."""

ALIKE = 1e-6
"""s. Steps this near to each other are one, whose transition is known: stamps in double seconds make them."""


@njit(cache=True, nogil=True, error_model="numpy")
def _run(model, state, t, kind, values, out):  # type: ignore[no-untyped-def]
    for k in range(len(t)):
        out[k, 0] = out[k, 1] = np.nan
        if state.clock[kf.STARTED] == 0.0:
            state.clock[kf.STARTED], state.clock[kf.NOW] = 1.0, t[k]
        step = t[k] - state.clock[kf.NOW]
        near = abs(step - model.held[1]) < ALIKE
        kf.predict(model, state, state.clock[kf.NOW] + model.held[1] if near else t[k])
        if kind[k] == COMMAND:
            state.clock[kf.FORCED], state.clock[kf.SINCE] = values[k, 0], t[k]
            continue
        for i in range(9):
            state.score[i] = 0.0
        channel = kf.POSITION if kind[k] == STATE else kf.WRENCH
        if kind[k] == STATE:
            kf.weigh_torque(model, state, values[k, 1])
        kf.update(model, state, channel, values[k, 0])
        if state.score[3 * channel + 1] > 0.0:
            out[k, 0] = math.copysign(math.sqrt(state.score[3 * channel]), state.score[3 * channel + 2])
        if state.score[7] > 0.0:
            out[k, 1] = math.copysign(math.sqrt(state.score[6]), state.score[8])


def events_of(record: Record) -> tuple[FloatArray, IntArray, FloatArray]:
    """Return the events of a record in order: t (s, shape (n,)), kind, and values (n, 2): position with the
    motor torque of the same stamp, ft, or command; nan where there is none."""
    t, kind, values = [np.empty(0)], [np.empty(0, np.int64)], [np.empty((0, 2))]
    torque: dict[float, float] = {}
    if "motor_torque" in record:
        torque = dict(zip(record["motor_torque"].t.tolist(), record["motor_torque"].y.tolist(), strict=True))
    for name, number in (("position", STATE), ("ft", FT), ("command", COMMAND)):
        if name in record:
            at = record[name].t
            beside = [torque.get(s, math.nan) if number == STATE else math.nan for s in at.tolist()]
            t.append(at)
            kind.append(np.full(len(at), number))
            values.append(np.column_stack([record[name].y, beside]))
    whole, kinds = np.concatenate(t), np.concatenate(kind)
    order = np.lexsort((kinds, whole))
    return whole[order], kinds[order], np.concatenate(values)[order]


class BatchObserver:
    """An observer of separate blocks. hold: how long a command stays in force, s.

    Not to be confused with `Observer`, which takes single samples in any order and gives torques.
    """

    def __init__(self, rig: Rig, noise: Noise, *, hold: float = math.inf) -> None:
        plain, self._delay = without_delay(rig)
        self._model, self._state = assemble(plain, noise, hold=hold, duration=60.0, learns=False)
        self._start = self._state.whole.copy()

    def innovations(self, t: FloatArray, kind: IntArray, values: FloatArray) -> FloatArray:
        """Return the innovations over their standard deviations, shape (n, 2); nan at a command.

        t: s, rising, shape (n,). kind: of log.py. values: as there, shape (n, 2). The filter begins with
        no knowledge, so the innovations of the first tenths of a second come from its settling.
        """
        t = t + np.where(kind == COMMAND, self._delay, 0.0)
        order = np.lexsort((kind, t))
        out, done = np.empty((len(t), 2)), np.empty((len(t), 2))
        self._state.whole[:] = self._start
        _run(self._model, self._state, t[order], kind[order], values[order], done)
        out[order] = done
        return out
