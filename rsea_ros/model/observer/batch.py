"""The same filter over a block of events at once: its whitened innovations, as a test of the model.

The events are in order, so there is no log of checkpoints as `Observer` keeps one (log.py), and nothing is
said of the torques' doubt.
"""

from __future__ import annotations

import math

import numpy as np

from rsea_ros.compiler import njit
from rsea_ros.model.observer.assemble import assemble, without_delay
from rsea_ros.model.observer.filter import (
    FORCED,
    NOW,
    POSITION,
    SINCE,
    STARTED,
    WRENCH,
    predict,
    update,
    weigh_torque,
)
from rsea_ros.model.observer.log import COMMAND, STATE
from rsea_ros.model.observer.signal_noise import Noise
from rsea_ros.model.rig import Rig
from rsea_ros.records.record import FloatArray, IntArray

MEASURED, TORQUE = range(2)
"""Columns of innovations: position or ft, whichever the event brings; motor torque."""

ALIKE = 1e-6
"""s. Steps this near to each other are one, whose transition is known: stamps in double seconds make them."""


@njit(cache=True, nogil=True, error_model="numpy")
def _run(model, state, t, kind, values, out):  # type: ignore[no-untyped-def]
    for k in range(len(t)):
        out[k, 0] = out[k, 1] = np.nan
        if state.clock[STARTED] == 0.0:
            state.clock[STARTED], state.clock[NOW] = 1.0, t[k]
        step = t[k] - state.clock[NOW]
        near = abs(step - model.held[1]) < ALIKE
        predict(model, state, state.clock[NOW] + model.held[1] if near else t[k])
        if kind[k] == COMMAND:
            state.clock[FORCED], state.clock[SINCE] = values[k, 0], t[k]
            continue
        for i in range(9):
            state.score[i] = 0.0
        channel = POSITION if kind[k] == STATE else WRENCH
        if kind[k] == STATE:
            weigh_torque(model, state, values[k, 1])
        update(model, state, channel, values[k, 0])
        if state.score[3 * channel + 1] > 0.0:
            out[k, 0] = math.copysign(math.sqrt(state.score[3 * channel]), state.score[3 * channel + 2])
        if state.score[7] > 0.0:
            out[k, 1] = math.copysign(math.sqrt(state.score[6]), state.score[8])


class BatchObserver:
    """An observer of separate blocks. hold: how long a command stays in force, s.

    duration: over which drifts of the rig reach their full size, s. Not to be confused with `Observer`,
    which takes single samples in any order and gives torques.
    """

    def __init__(self, rig: Rig, noise: Noise, *, hold: float = math.inf, duration: float = 60.0) -> None:
        plain, self._delay = without_delay(rig)
        self._model, self._state = assemble(plain, noise, hold=hold, duration=duration)
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
