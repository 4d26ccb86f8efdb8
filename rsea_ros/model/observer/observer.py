"""The observer: samples in, torques on both ends out."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from rsea_ros.model.observer.assemble import assemble, without_delay
from rsea_ros.model.observer.consistency import Consistency, consistency
from rsea_ros.model.observer.filter import SIGMA
from rsea_ros.model.observer.handle import handle_of, receive
from rsea_ros.model.observer.log import COMMAND, FT, LATE, REFUSED, STATE, empty_log
from rsea_ros.model.observer.signal_noise import Noise, noise_of
from rsea_ros.model.observer.transition import transition
from rsea_ros.model.rig import Rig
from rsea_ros.records.record import FloatArray, Record

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
    time in which drifts reach their full size, s. Estimates are torques on both ends, N m, with one sigma.
    `observe` runs it over a record. Method: docs/observer.md.
    Not to be confused with the disturbance observer inside TorqueController.
    """

    _score: FloatArray
    _newest: float

    def __init__(self, rig: Rig, noise: Noise | None = None, *, hold: float = math.inf,
                 duration: float = 60.0) -> None:  # fmt: skip
        self._rig, self._delay = without_delay(rig)
        self._noise = noise_of(rig) if noise is None else noise
        self._hold, self._duration = hold, duration
        self._estimate = np.zeros(2 * SIGMA)
        self.restarts = -1
        self._begin()

    def command(self, t: float, torque: float) -> None:
        """Add a command (N m) that takes effect at its stamp, which may be ahead of the measurements."""
        self._take(t, COMMAND, torque, 0.0)

    def state(self, t: float, position: float, motor_torque: float = math.nan) -> TorqueEstimate | None:
        """Add position (rad) and motor torque (N m, nan if missing); return None for a sample too late."""
        return self._take(t, STATE, position, motor_torque)

    def ft(self, t: float, torque: float) -> TorqueEstimate | None:
        """Add a torque of the F/T sensor (N m); return None for a sample that is too late."""
        return self._take(t, FT, torque, 0.0)

    @property
    def late(self) -> int:
        """Number of late samples that were inserted at their stamps."""
        return int(self._log.place[LATE])

    @property
    def refused(self) -> int:
        """Number of samples that came too late."""
        return int(self._log.place[REFUSED])

    def consistency(self) -> dict[str, Consistency]:
        """Return for each channel the innovations since the last call over their expected size."""
        now = self._state.score.reshape(3, 3).copy()
        change = now - self._score
        self._score = now
        return consistency(change)

    def error_model(self, dt: float) -> ErrorModel:
        """Return the error dynamics at a period of dt s, with the present gain K = P h' / r."""
        m, p, size = self._model, self._state.p, len(self._state.p)
        f, q = np.empty((size, size)), np.empty((size, size))
        transition(m.a, m.walk, m.scale, dt, f, q)
        k = p @ m.measured.T / m.noise[:2]
        heard = np.where(np.isfinite(m.noise[:2]), m.noise[:2], 0.0)
        sigma = float(self._state.estimate[SIGMA])
        return ErrorModel((np.eye(size) - k @ m.measured) @ f, k, heard, m.estimated[0], sigma)

    def _begin(self) -> None:
        self._model, self._state = assemble(self._rig, self._noise, hold=self._hold, duration=self._duration)
        self._log = empty_log(len(self._state.whole))
        self._handle = handle_of(self._model, self._state, self._log)
        self._rest, self._reads_load = self._model.linear.rest, self._model.linear.reads_load
        self._score, self._newest = np.zeros((3, 3)), math.nan
        self.restarts += 1

    def _take(self, t: float, kind: int, a: float, b: float) -> TorqueEstimate | None:
        if abs(t - self._newest) > GAP:
            self._begin()
        if kind == COMMAND:
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
    wanted, t, rows = ("ft" if "ft" in record else "position"), [], []
    for stamp, channel, a, b in _events(record):
        if channel == "command":
            observer.command(stamp, a)
            continue
        estimate = observer.state(stamp, a, b) if channel == "position" else observer.ft(stamp, a)
        if channel == wanted and estimate is not None:
            t.append(stamp)
            rows.append(estimate)
    return np.array(t), np.array(rows)


def _events(record: Record) -> Iterator[tuple[float, str, float, float]]:
    """Yield the samples of a record by stamp, position with the motor torque of the same stamp."""
    events: list[tuple[float, int, str, float, float]] = []
    torque = {}
    if "motor_torque" in record:
        torque = dict(zip(record["motor_torque"].t.tolist(), record["motor_torque"].y.tolist(), strict=True))
    for order, name in enumerate(("position", "ft", "command")):
        if name in record:
            pairs = zip(record[name].t.tolist(), record[name].y.tolist(), strict=True)
            events += [(t, order, name, y, torque.get(t, math.nan)) for t, y in pairs]
    events.sort(key=lambda event: event[:2])
    yield from ((t, name, a, b) for t, _, name, a, b in events)
