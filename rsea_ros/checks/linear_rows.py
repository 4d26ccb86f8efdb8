"""The rig's linear model as rows of a least-squares problem, each with its step of a parameter.

Unknowns beside the rig's values, for each of F/T sensor, position and velocity: how late its stamps are at
the start of the record (offset, s), how that grows (drift, s/s), bias, gain.

The covariance is the sandwich over blocks of one second (identification/confidence.py says why).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from rsea_ros.identification.problem import Case, Problem
from rsea_ros.identification.settings import INTERVALS
from rsea_ros.identification.solver import jacobian
from rsea_ros.identification.unknowns import Unknown, clocks, start_vector
from rsea_ros.model.rig import Rig
from rsea_ros.model.simulation import drive_of
from rsea_ros.records.record import Channel, FloatArray, IntArray, Record

_LEAST_MISFIT = 0.5
_BLOCKS = 40
"""At least: with fewer than unknowns a sandwich is too thin."""
_NEAR = 0.02
"""Of the scale of every value: a move so small leaves the derivatives as they are."""


class LinearState(NamedTuple):
    """Values of the rig in the fit's coordinates; offset (s) and drift (s/s) of each timed channel."""

    theta: FloatArray
    offset: FloatArray
    drift: FloatArray

    def move(self, step: FloatArray) -> LinearState:
        """Return the state after a step; a clock that reads later than stamped is stamped early."""
        n, m = len(self.theta), len(self.offset)
        return LinearState(
            self.theta + step[:n], self.offset - step[n : n + m], self.drift - step[n + m : n + 2 * m]
        )


class LinearSetting(NamedTuple):
    """The constants of all rounds. start: of the whole record, s."""

    record: Record
    start: float
    case: Case
    rig: Rig
    timed: tuple[str, ...]
    values: tuple[Unknown, ...]


def on_time(record: Record, start: float, timed: Sequence[str], state: LinearState) -> Record:
    """Return the record with the stamps that its sensors would have had without offset and drift."""
    moved = {}
    for n, late, grows in zip(timed, state.offset, state.drift, strict=True):
        moved[n] = Channel(record[n].t - late - grows * (record[n].t - start), record[n].y)
    return record.with_channels(**moved)


@dataclass(frozen=True)
class FitResidual:
    """The residual of a state: residual over noise, shape (m,), with its problem and state.

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
        """The loss that the rounds minimise: the product of the misfits."""
        return float(np.prod(self.misfit))


class Slope(NamedTuple):
    """Derivatives of the residual over the noise by values and clocks, shape (m, n), and where they hold."""

    matrix: FloatArray
    theta: FloatArray

    def holds_at(self, theta: FloatArray, unknowns: Sequence[Unknown]) -> bool:
        """Return whether another place is so near that the derivatives are the same."""
        return bool(np.all(np.abs(theta - self.theta) < _NEAR * np.array([u.scale for u in unknowns])))


@dataclass(frozen=True)
class LinearisedRows:
    """Residual r (m,) and derivatives (m, n) in units of the misfit.

    Columns: the rig's values, then for each channel its clock, drift, bias and gain. block: of each row.
    slope: from which the derivatives are computed.
    """

    left: FitResidual
    slope: Slope
    residual: FloatArray
    matrix: FloatArray
    block: IntArray


def residual_at(setting: LinearSetting, state: LinearState) -> FitResidual:
    """Return the residual of a state, by one simulation."""
    record = on_time(setting.record, setting.start, setting.timed, state)
    case = replace(setting.case, drive=drive_of(record, setting.rig))
    wide = tuple(replace(u, low=-1.0, high=1.0) for u in clocks(setting.timed, setting.rig))
    problem = Problem((case,), setting.rig, (*setting.values, *wide), setting.timed)
    theta = np.concatenate([state.theta, np.zeros(len(wide))])
    residual, of = problem.residual(theta), _channel_of(case, setting.timed)
    noise, y = _of_rows(case, case.noise, setting.timed), _of_rows(case, case.measured, setting.timed)
    plain = np.column_stack([1.0 / noise, y / noise + residual])
    return FitResidual(problem, theta, residual, plain, of, _misfits(residual, plain, of, len(setting.timed)))


def _channel_of(case: Case, timed: Sequence[str]) -> IntArray:
    """Return the channel of every row, as its number in `timed`."""
    return np.repeat(np.arange(len(timed)), [int(case.mask[n].sum()) for n in timed])


def _of_rows(case: Case, what: Mapping[str, float | FloatArray], timed: Sequence[str]) -> FloatArray:
    """Spread a value of each channel, or of each of its samples, over the rows."""
    return np.concatenate([np.broadcast_to(what[n], case.t[n].shape)[case.mask[n]] for n in timed])


def _misfits(residual: FloatArray, plain: FloatArray, of: IntArray, m: int) -> FloatArray:
    """Return the RMS over noise of each channel's residual, without bias and gain."""
    misfits = []
    for k in range(m):
        columns, residuals = plain[of == k], residual[of == k]
        unexplained = residuals - columns @ np.linalg.lstsq(columns, residuals, rcond=None)[0]
        misfits.append(float(np.sqrt(np.mean(unexplained**2))))
    return np.array(misfits)


def rows_of(setting: LinearSetting, residual: FitResidual, known: Slope | None = None) -> LinearisedRows:
    """Lay out the rows about a state: one simulation for each unknown, none where a slope is known near."""
    (case,), n, at = residual.problem.cases, len(setting.values), residual.theta
    if known is None or not known.holds_at(at, residual.problem.unknowns):
        known = Slope(jacobian(residual.problem, at, residual.residual), at)
    moved = known.matrix
    t = _of_rows(case, case.t, setting.timed)
    of_channel = (residual.of == np.arange(len(setting.timed))[:, None]).astype(float).T
    columns = [moved[:, n:] * (t - setting.start)[:, None]]
    columns += [of_channel * column[:, None] for column in residual.plain.T]
    weight = 1.0 / np.maximum(residual.misfit, _LEAST_MISFIT)[residual.of]
    block = np.floor((t - t.min()) / min(INTERVALS.block, case.duration / _BLOCKS)).astype(np.int64)
    matrix = np.column_stack([moved, *columns]) * weight[:, None]
    return LinearisedRows(residual, known, residual.residual * weight, matrix, block)


_OFFSET_DOUBT, _DRIFT_DOUBT, _GAIN_DOUBT = 0.05, 1e-3, 0.25
"""One sigma before: s, s/s, 1."""
_WIDER = 3.0


def gauss_newton_step(
    rows: LinearisedRows, setting: LinearSetting, state: LinearState
) -> tuple[FloatArray, FloatArray]:
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


def _scores(rows: LinearisedRows, left: FloatArray) -> FloatArray:
    """Return the sum of the scores of each block, shape (blocks, unknowns)."""
    first = np.flatnonzero(np.diff(rows.block, prepend=-1))
    parts = np.add.reduceat(rows.matrix * left[:, None], first, axis=0)
    scores = np.zeros((int(rows.block.max()) + 1, rows.matrix.shape[1]))
    np.add.at(scores, rows.block[first], parts)
    return scores


def _doubt(u: Unknown) -> float:
    return u.doubt if np.isfinite(u.doubt) else u.scale
