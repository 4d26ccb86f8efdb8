"""The rig linearised about its quick fit: clocks of the sensors, and what these data can determine.

Unknowns beside the rig's values, for each of F/T sensor, position and velocity: how late its stamps are at
the start of the record (offset, s), how that grows (drift, s/s), bias, gain. Gauss-Newton on output errors
with the sandwich covariance over blocks of one second (identification/confidence.py says why).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from rsea_ros.checks.shape import Shape
from rsea_ros.identification.confidence import BLOCK
from rsea_ros.identification.problem import Case, Problem, case_from, channels_that_tell
from rsea_ros.identification.solver import jacobian
from rsea_ros.identification.unknowns import (
    Unknown,
    clocks,
    start_vector,
    unknowns_of_rig,
)
from rsea_ros.model.rig import Rig
from rsea_ros.model.simulation import drive_of
from rsea_ros.signals import BoolArray, Channel, FloatArray, IntArray, Record

TIMED = ("ft", "deflection", "position", "velocity")
"""Channels whose clocks are sought; the motor torque is held from command to command and shows none."""
_Z95 = 1.959964
_ROUNDS = 6
_PARTS = (1.0, 0.5, 0.25, 0.1)
"""Of a step, tried until the loss falls."""
_WORSE = 1.02
"""Of the best loss so far: a round that leaves more is not taken."""
_LEAST_MISFIT = 0.5
_DONE = 0.8
"""Of one sigma: smaller steps end the rounds."""
LONGEST = 30.0
"""s. More of a record would only cost more time."""
_OFFSET_DOUBT, _DRIFT_DOUBT, _GAIN_DOUBT = 0.05, 1e-3, 0.25
"""One sigma before: s, s/s, 1."""
_WIDER = 3.0
_BLOCKS = 40
"""At least: with fewer than unknowns a sandwich is too thin."""
_NEAR = 0.02
"""Of the scale of every value: a move so small leaves the derivatives as they are."""
_RESOLUTION = 3e-6
"""s. No clock is known better: the fixed step interpolates between its ends."""


@dataclass(frozen=True)
class Number:
    """A value with one sigma."""

    value: float
    sd: float

    @property
    def ci95(self) -> tuple[float, float]:
        """The 95 % interval."""
        return self.value - _Z95 * self.sd, self.value + _Z95 * self.sd


class Brought(NamedTuple):
    """What data bring of a value: the share of what is known of it then, and its one sigma over its size."""

    share: float
    relative_sd: float


@dataclass(frozen=True)
class Linear:
    """What the linearised fit says. offset: s at the start of the record, drift: s/s, by channel.

    misfit: RMS of the residual over the noise by channel. values: what these data bring of the rig's values.
    settled: whether the clocks stood still at last; else their numbers mean nothing.
    """

    offset: Mapping[str, Number]
    drift: Mapping[str, Number]
    misfit: Mapping[str, float]
    values: Mapping[str, Brought]
    settled: bool


def linear_of(record: Record, masked: Mapping[str, BoolArray], rig: Rig, shape: Shape) -> Linear:
    """Return the linearised fit from where the quick fit of the shape ended.

    Only the LONGEST of the record in which the command changes most is looked at. Raises IdentificationError
    where the record has no channel of the rig's.
    """
    start = float(record["command"].t[0])
    begin, end = _liveliest(record["command"])
    record = replace(record, channels={n: c for n, c in record.channels.items() if n != "motor_torque"})
    record, masked = _cut(record, masked, begin, end)
    timed = tuple(n for n in TIMED if n in channels_that_tell(record, rig))
    values = unknowns_of_rig(rig)
    theta = np.array([u.inner(shape.values.get(u.name, u.start)) for u in values])
    state = _State(theta, np.array([shape.delay.get(n, 0.0) for n in timed]), np.zeros(len(timed)))
    case = case_from(_on_time(record, start, timed, state), rig, masked)
    setting = _Setting(record, start, case, rig, timed, values)
    rows = _rows(setting, _left(setting, state))
    step, sd = _solved(rows, setting, state)
    settled = False
    for k in range(_ROUNDS):
        parts = _PARTS[k // 2 :]  # whole steps turn to and fro about the end
        tried = ((at, _left(setting, at)) for at in (state.moved(part * step) for part in parts))
        better = next((t for t in tried if t[1].loss < _WORSE * rows.left.loss), None)
        if better is None:
            break
        state, rows = better[0], _rows(setting, better[1], rows.slope)
        step, sd = _solved(rows, setting, state)
        clock_steps = slice(len(theta), len(theta) + 2 * len(timed))
        finest = np.repeat([_RESOLUTION, _RESOLUTION / case.duration], len(timed))
        if np.all(np.abs(step[clock_steps]) < _DONE * np.hypot(sd[clock_steps], finest)):
            settled = True
            break
    return _linear(setting, state.moved(0.5 * step), rows, sd, settled)


def _liveliest(command: Channel) -> tuple[float, float]:
    """Return begin and end (s) of the LONGEST of a record in which the command changes most."""
    begins = np.arange(command.t[0], max(command.t[-1] - LONGEST, command.t[0]) + 1e-9, LONGEST / 4.0)
    change = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(command.y)))])
    within = [np.diff(np.interp([b, b + LONGEST], command.t, change))[0] for b in begins]
    begin = float(begins[int(np.argmax(within))])
    return begin, begin + LONGEST


def _cut(
    record: Record, masked: Mapping[str, BoolArray], begin: float, end: float
) -> tuple[Record, dict[str, BoolArray]]:
    """Return record and masks between two instants (s), as they are where that is all of them."""
    inside = {n: (c.t >= begin) & (c.t < end) for n, c in record.channels.items()}
    return record.between(begin, end), {n: masked[n][keep] for n, keep in inside.items() if n in masked}


def _linear(setting: _Setting, state: _State, rows: _Rows, sd: FloatArray, settled: bool) -> Linear:
    n, m = len(setting.values), len(setting.timed)
    late, grows = np.hypot(sd[n : n + m], _RESOLUTION), sd[n + m : n + 2 * m]
    return Linear(
        offset={c: Number(float(state.offset[k]), float(late[k])) for k, c in enumerate(setting.timed)},
        drift={c: Number(float(state.drift[k]), float(grows[k])) for k, c in enumerate(setting.timed)},
        misfit=dict(zip(setting.timed, rows.left.misfit.tolist(), strict=True)),
        values=_brought(setting, rows),
        settled=settled,
    )


class _State(NamedTuple):
    """Values of the rig in the fit's coordinates; offset (s) and drift (s/s) of each timed channel."""

    theta: FloatArray
    offset: FloatArray
    drift: FloatArray

    def moved(self, step: FloatArray) -> _State:
        """Return the state after a step; a clock that reads later than stamped is stamped early."""
        n, m = len(self.theta), len(self.offset)
        return _State(
            self.theta + step[:n], self.offset - step[n : n + m], self.drift - step[n + m : n + 2 * m]
        )


class _Setting(NamedTuple):
    """What stays the same in all rounds. start: of the whole record, s."""

    record: Record
    start: float
    case: Case
    rig: Rig
    timed: tuple[str, ...]
    values: tuple[Unknown, ...]


def _on_time(record: Record, start: float, timed: Sequence[str], state: _State) -> Record:
    """Return the record with the stamps that its sensors would have had without offset and drift."""
    moved = {}
    for n, late, grows in zip(timed, state.offset, state.drift, strict=True):
        moved[n] = Channel(record[n].t - late - grows * (record[n].t - start), record[n].y)
    return record.with_channels(**moved)


@dataclass(frozen=True)
class _Left:
    """What a state leaves of the record: residual over noise, shape (m,), with the problem and where it is.

    plain: derivatives of each channel's residual by bias and gain, shape (m, 2). of: channel of each row.
    misfit: RMS over noise of each channel without bias and gain.
    """

    problem: Problem
    theta: FloatArray
    residual: FloatArray
    plain: FloatArray
    of: IntArray
    misfit: FloatArray

    @property
    def loss(self) -> float:
        """What rounds lower: the product of the misfits."""
        return float(np.prod(self.misfit))


class _Slope(NamedTuple):
    """Derivatives of the residual over the noise by values and clocks, shape (m, n), and where they hold."""

    matrix: FloatArray
    theta: FloatArray

    def holds_at(self, theta: FloatArray, unknowns: Sequence[Unknown]) -> bool:
        """Tell whether another place is so near that the derivatives are the same."""
        return bool(np.all(np.abs(theta - self.theta) < _NEAR * np.array([u.scale for u in unknowns])))


@dataclass(frozen=True)
class _Rows:
    """Residual r (m,) and derivatives (m, n) in units of the misfit.

    Columns: the rig's values, then for each channel its clock, drift, bias and gain. block: of each row.
    slope: what the derivatives are made of.
    """

    left: _Left
    slope: _Slope
    residual: FloatArray
    matrix: FloatArray
    block: IntArray


def _left(setting: _Setting, state: _State) -> _Left:
    """Return what a state leaves: one simulation."""
    record = _on_time(setting.record, setting.start, setting.timed, state)
    case = replace(setting.case, drive=drive_of(record, setting.rig))
    wide = tuple(replace(u, low=-1.0, high=1.0) for u in clocks(setting.timed, setting.rig))
    problem = Problem((case,), setting.rig, (*setting.values, *wide), setting.timed)
    theta = np.concatenate([state.theta, np.zeros(len(wide))])
    residual, of = problem.residual(theta), _channel_of(case, setting.timed)
    noise, y = _of_rows(case, case.noise, setting.timed), _of_rows(case, case.measured, setting.timed)
    plain = np.column_stack([1.0 / noise, y / noise + residual])
    return _Left(problem, theta, residual, plain, of, _misfits(residual, plain, of, len(setting.timed)))


def _channel_of(case: Case, timed: Sequence[str]) -> IntArray:
    """Return the channel of every row, as its number in `timed`."""
    return np.repeat(np.arange(len(timed)), [int(case.mask[n].sum()) for n in timed])


def _of_rows(case: Case, what: Mapping[str, float | FloatArray], timed: Sequence[str]) -> FloatArray:
    """Return what belongs to each channel, or to each of its samples, for every row."""
    return np.concatenate([np.broadcast_to(what[n], case.t[n].shape)[case.mask[n]] for n in timed])


def _misfits(residual: FloatArray, plain: FloatArray, of: IntArray, m: int) -> FloatArray:
    """Return the RMS over noise of each channel's residual, without bias and gain."""
    found = []
    for k in range(m):
        columns, here = plain[of == k], residual[of == k]
        left = here - columns @ np.linalg.lstsq(columns, here, rcond=None)[0]
        found.append(float(np.sqrt(np.mean(left**2))))
    return np.array(found)


def _rows(setting: _Setting, left: _Left, known: _Slope | None = None) -> _Rows:
    """Lay out the rows about a state: one simulation for each unknown, none where a slope is known near."""
    (case,), n, at = left.problem.cases, len(setting.values), left.theta
    if known is None or not known.holds_at(at, left.problem.unknowns):
        known = _Slope(jacobian(left.problem, at, left.residual), at)
    moved = known.matrix
    t = _of_rows(case, case.t, setting.timed)
    of_channel = (left.of == np.arange(len(setting.timed))[:, None]).astype(float).T
    own = [moved[:, n:] * (t - setting.start)[:, None]]
    own += [of_channel * column[:, None] for column in left.plain.T]
    weight = 1.0 / np.maximum(left.misfit, _LEAST_MISFIT)[left.of]
    block = np.floor((t - t.min()) / min(BLOCK, case.duration / _BLOCKS)).astype(np.int64)
    return _Rows(left, known, left.residual * weight, np.column_stack([moved, *own]) * weight[:, None], block)


def _solved(rows: _Rows, setting: _Setting, state: _State) -> tuple[FloatArray, FloatArray]:
    """Return the step of every unknown and its one sigma."""
    m, matrix = len(setting.timed), rows.matrix
    doubt = [_WIDER * _doubt(u) for u in setting.values]
    doubt += [_OFFSET_DOUBT] * m + [_DRIFT_DOUBT] * m + [np.inf] * m + [_GAIN_DOUBT] * m
    prior = np.array(doubt) ** -2.0
    off = state.theta - start_vector(setting.values)
    at = np.concatenate([off, -state.offset, -state.drift, np.zeros(2 * m)])
    normal = matrix.T @ matrix + np.diag(prior)
    scale = np.sqrt(np.diag(normal) + 1e-300)
    inverse = np.linalg.pinv(normal / np.outer(scale, scale), hermitian=True) / np.outer(scale, scale)
    step = -inverse @ (matrix.T @ rows.residual + prior * at)
    scores = _scores(rows, rows.residual + matrix @ step)
    covariance = inverse @ (scores.T @ scores + np.diag(prior)) @ inverse
    return step, np.sqrt(np.maximum(np.diag(covariance), np.diag(inverse)))


def _scores(rows: _Rows, left: FloatArray) -> FloatArray:
    """Return the sum of the scores of each block, shape (blocks, unknowns)."""
    first = np.flatnonzero(np.diff(rows.block, prepend=-1))
    parts = np.add.reduceat(rows.matrix * left[:, None], first, axis=0)
    scores = np.zeros((int(rows.block.max()) + 1, rows.matrix.shape[1]))
    np.add.at(scores, rows.block[first], parts)
    return scores


def _brought(setting: _Setting, rows: _Rows) -> dict[str, Brought]:
    """Return by value of the rig what the data bring of it.

    Gains and drifts count as known: they are what a check looks for, not what a fit frees.
    """
    values, n, m = setting.values, len(setting.values), len(setting.timed)
    if not n:
        return {}
    keep = [*range(n + m), *range(n + 2 * m, n + 3 * m)]
    columns = rows.matrix[:, keep]
    clock_doubts = [setting.rig.clock_doubt(c) for c in setting.timed]
    doubt = np.array([*(_doubt(u) for u in values), *clock_doubts, *[np.inf] * m])
    part = columns.T @ columns + np.diag(doubt**-2.0)
    scale = np.sqrt(np.diag(part) + 1e-300)
    after = np.sqrt(np.diag(np.linalg.pinv(part / np.outer(scale, scale), hermitian=True))) / scale
    size = [1.0 if u.logarithmic else abs(u.start) or 1.0 for u in values]
    return {
        u.name: Brought(float(max(0.0, 1.0 - (sd / before) ** 2)), float(sd / scale))
        for u, sd, before, scale in zip(values, after, doubt, size, strict=False)
    }


def _doubt(u: Unknown) -> float:
    return u.doubt if np.isfinite(u.doubt) else u.scale
