"""The rig linearised about its quick fit: rows of least squares, their solution, the clocks of sensors.

Gauss-Newton on output errors. Unknowns beside the rig's values, for each of F/T sensor, position and
velocity: how late its stamps are at the start of the record (offset, s), how that grows (drift, s/s), bias,
gain.

The covariance is the sandwich over blocks of one second (identification/confidence.py says why).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from rsea_ros.errors import IdentificationError
from rsea_ros.identification.confidence import BLOCK, inverse_of, sum_by_block
from rsea_ros.identification.problem import Case, Problem, case_from, channels_that_tell
from rsea_ros.identification.solver import jacobian
from rsea_ros.identification.unknowns import Unknown, clocks, start_vector, unknowns_of_rig
from rsea_ros.model.rig import Rig
from rsea_ros.model.simulation import drive_of
from rsea_ros.records.record import SENSED, BoolArray, Channel, FloatArray, IntArray, Record
from rsea_ros.records.statistics import Z95

_LEAST_MISFIT = 0.5
_BLOCKS = 40
"""At least: with fewer than unknowns a sandwich is too thin."""
_NEAR = 0.02
"""Of the scale of every value: a move so small leaves the derivatives as they are."""


class Start(NamedTuple):
    """Where the rounds begin. values: of the rig, by name; delay: s, by channel."""

    values: Mapping[str, float]
    delay: Mapping[str, float]


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
    of = np.repeat(np.arange(len(setting.timed)), [int(case.mask[n].sum()) for n in setting.timed])
    residual = problem.residual(theta)
    noise, y = _of_rows(case, case.noise, setting.timed), _of_rows(case, case.measured, setting.timed)
    plain = np.column_stack([1.0 / noise, y / noise + residual])
    return FitResidual(problem, theta, residual, plain, of, _misfits(residual, plain, of, len(setting.timed)))


def _of_rows(case: Case, what: Mapping[str, float | FloatArray], timed: Sequence[str]) -> FloatArray:
    """Spread a value of each channel, or of each of its samples, over the rows."""
    return np.concatenate([np.broadcast_to(what[n], case.t[n].shape)[case.mask[n]] for n in timed])


def _misfits(residual: FloatArray, plain: FloatArray, of: IntArray, m: int) -> FloatArray:
    """Return the RMS over noise of each channel's residual, without bias and gain."""
    parts = [(plain[of == k], residual[of == k]) for k in range(m)]
    unexplained = [y - columns @ np.linalg.lstsq(columns, y, rcond=None)[0] for columns, y in parts]
    return np.array([np.sqrt(np.mean(left**2)) for left in unexplained])


def rows_of(setting: LinearSetting, residual: FitResidual, known: Slope | None = None) -> LinearisedRows:
    """Lay out the rows about a state: one simulation for each unknown, none where a slope is known near."""
    (case,), n, at = residual.problem.cases, len(setting.values), residual.theta
    near = _NEAR * np.array([u.scale for u in residual.problem.unknowns])
    if known is None or not np.all(np.abs(at - known.theta) < near):
        known = Slope(jacobian(residual.problem, at, residual.residual), at)
    moved = known.matrix
    t = _of_rows(case, case.t, setting.timed)
    of_channel = (residual.of == np.arange(len(setting.timed))[:, None]).astype(float).T
    columns = [moved[:, n:] * (t - setting.start)[:, None]]
    columns += [of_channel * column[:, None] for column in residual.plain.T]
    weight = 1.0 / np.maximum(residual.misfit, _LEAST_MISFIT)[residual.of]
    block = np.floor((t - t.min()) / min(BLOCK, case.duration / _BLOCKS)).astype(np.int64)
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
    doubt = [_WIDER * (u.doubt if np.isfinite(u.doubt) else u.scale) for u in setting.values]
    doubt += [_OFFSET_DOUBT] * m + [_DRIFT_DOUBT] * m + [np.inf] * m + [_GAIN_DOUBT] * m
    prior = np.array(doubt) ** -2.0
    off = state.theta - start_vector(setting.values)
    at = np.concatenate([off, -state.offset, -state.drift, np.zeros(2 * m)])
    normal = matrix.T @ matrix + np.diag(prior)
    inverse = inverse_of(normal)
    step = -inverse @ (matrix.T @ rows.residual + prior * at)
    scores = sum_by_block(matrix, rows.residual + matrix @ step, rows.block)
    covariance = inverse @ (scores.T @ scores + np.diag(prior)) @ inverse
    return step, np.sqrt(np.maximum(np.diag(covariance), np.diag(inverse)))


_ROUNDS = 6
_PARTS = (1.0, 0.5, 0.25, 0.1)
"""Of a step, tried until the loss falls."""
_WORSE = 1.02
"""Of the best loss so far: a round that leaves more is not taken."""
_DONE = 0.8
"""Of one sigma: smaller steps end the rounds."""
BESIDE = 2.0
"""Residual over noise above which something in the machine may stand behind a clock."""
LONGEST = 30.0
"""s. More of a record would only cost more time."""
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
        return self.value - Z95 * self.sd, self.value + Z95 * self.sd


@dataclass(frozen=True)
class LinearisedFit:
    """The result of the linearised fit. offset: s at the start of the record, drift: s/s, by channel.

    misfit: RMS of the residual over the noise by channel.
    settled: whether the clocks converged; otherwise their numbers are meaningless. problem, theta: the fit
    of the values with the clocks set right, and where the rounds ended.
    """

    offset: Mapping[str, Number]
    drift: Mapping[str, Number]
    misfit: Mapping[str, float]
    settled: bool
    problem: Problem
    theta: FloatArray

    @property
    def fits(self) -> bool:
        """Whether no channel has a misfit for which a clock might stand in."""
        return all(misfit < BESIDE for misfit in self.misfit.values())

    @property
    def is_clear(self) -> bool:
        """Whether the clocks converged and the rig fits."""
        return self.settled and self.fits


def linear_of(record: Record, masked: Mapping[str, BoolArray], rig: Rig, known: Start) -> LinearisedFit:
    """Return the linearised fit from where the quick fit of the shape ended.

    Only the LONGEST of the record in which the command changes most is looked at. Raises IdentificationError
    where the record has no channel of the rig's, or all their samples are masked.
    """
    setting, state = _setting(record, masked, rig, known)
    state, rows, sd, settled = _descend(setting, state)
    n, m = len(setting.values), len(setting.timed)
    late, grows = np.hypot(sd[n : n + m], _RESOLUTION), sd[n + m : n + 2 * m]
    return LinearisedFit(
        offset={c: Number(float(state.offset[k]), float(late[k])) for k, c in enumerate(setting.timed)},
        drift={c: Number(float(state.drift[k]), float(grows[k])) for k, c in enumerate(setting.timed)},
        misfit=dict(zip(setting.timed, rows.left.misfit.tolist(), strict=True)),
        settled=settled,
        problem=rows.left.problem,
        theta=state.theta,
    )


def _setting(
    record: Record, masked: Mapping[str, BoolArray], rig: Rig, known: Start
) -> tuple[LinearSetting, LinearState]:
    """Return the constants of all rounds, and the state where the quick fit ended."""
    start = float(record["command"].t[0])
    record = replace(record, channels={n: c for n, c in record.channels.items() if n != "motor_torque"})
    begin, end = _liveliest(record, masked)
    inside = {n: (c.t >= begin) & (c.t < end) for n, c in record.channels.items() if n in masked}
    record, masked = record.between(begin, end), {n: masked[n][keep] for n, keep in inside.items()}
    informative = channels_that_tell(record, rig)
    sensed = [n for n in SENSED if n in informative]  # a held motor torque shows no clock
    values = unknowns_of_rig(rig)
    theta = np.array([u.inner(known.values.get(u.name, u.start)) for u in values])

    def start_state(timed: Sequence[str]) -> LinearState:
        return LinearState(theta, np.array([known.delay.get(n, 0.0) for n in timed]), np.zeros(len(timed)))

    case = case_from(on_time(record, start, sensed, start_state(sensed)), rig, masked)
    timed = tuple(n for n in sensed if case.mask[n].any())
    if not timed:
        raise IdentificationError(f"{record.source}: no sample of {rig.name}'s sensors is left to compare")
    return LinearSetting(record, start, case, rig, timed, values), start_state(timed)


def _descend(
    setting: LinearSetting, state: LinearState
) -> tuple[LinearState, LinearisedRows, FloatArray, bool]:
    """Return where the rounds end: the state, rows, one sigma of each unknown, whether the clocks stand."""
    rows = rows_of(setting, residual_at(setting, state))
    step, sd = gauss_newton_step(rows, setting, state)
    settled = False
    for k in range(_ROUNDS):
        parts = _PARTS[k // 2 :]  # whole steps turn to and fro about the end
        tried = ((at, residual_at(setting, at)) for at in (state.move(part * step) for part in parts))
        better = next((t for t in tried if t[1].loss < _WORSE * rows.left.loss), None)
        if better is None:
            break
        state, rows = better[0], rows_of(setting, better[1], rows.slope)
        step, sd = gauss_newton_step(rows, setting, state)
        n, m = len(setting.values), len(setting.timed)
        finest = np.repeat([_RESOLUTION, _RESOLUTION / setting.case.duration], m)
        clocks = slice(n, n + 2 * m)
        settled = bool(np.all(np.abs(step[clocks]) < _DONE * np.hypot(sd[clocks], finest)))
        if settled:
            break
    return state.move(0.5 * step), rows, sd, settled


def _liveliest(record: Record, masked: Mapping[str, BoolArray]) -> tuple[float, float]:
    """Return begin and end (s) of the LONGEST with most sensors in which the command changes most."""
    command = record["command"]
    begins = np.arange(command.t[0], max(command.t[-1] - LONGEST, command.t[0]) + 1e-9, LONGEST / 4.0)
    change = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(command.y)))])
    within = [np.diff(np.interp([b, b + LONGEST], command.t, change))[0] for b in begins]
    stamps = [c.t[~masked[n]] if n in masked else c.t for n, c in record.channels.items() if n in SENSED]
    inside = [np.diff(np.searchsorted(t, [begins, begins + LONGEST]), axis=0)[0] for t in stamps]
    counts = np.array(inside).reshape(len(stamps), len(begins))
    sensors = np.sum(counts > 0.5 * counts.max(axis=1, initial=1, keepdims=True), axis=0)
    begin = float(begins[np.lexsort((within, sensors))[-1]])
    return begin, begin + LONGEST
