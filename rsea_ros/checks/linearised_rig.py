"""The rig linearised about its quick fit: clocks of the sensors.

Gauss-Newton on output errors: linear_rows.py has the rows, linear_step.py the solution.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rsea_ros.checks.linear_rows import (
    LinearisedRows,
    LinearSetting,
    LinearState,
    gauss_newton_step,
    on_time,
    residual_at,
    rows_of,
)
from rsea_ros.checks.response_shape import FittedShape
from rsea_ros.errors import IdentificationError
from rsea_ros.identification.problem import Problem, case_from, channels_that_tell
from rsea_ros.identification.unknowns import unknowns_of_rig
from rsea_ros.model.rig import Rig
from rsea_ros.records.normal import Z95
from rsea_ros.records.record import SENSED, BoolArray, FloatArray, Record

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
    def is_clear(self) -> bool:
        """Whether the clocks converged and no channel has a misfit that they might stand in for."""
        return self.settled and all(misfit < BESIDE for misfit in self.misfit.values())


def linear_of(record: Record, masked: Mapping[str, BoolArray], rig: Rig, shape: FittedShape) -> LinearisedFit:
    """Return the linearised fit from where the quick fit of the shape ended.

    Only the LONGEST of the record in which the command changes most is looked at. Raises IdentificationError
    where the record has no channel of the rig's, or all their samples are masked.
    """
    setting, state = _setting(record, masked, rig, shape)
    state, rows, sd, settled = _descend(setting, state)
    return _linear(setting, state, rows, sd, settled)


def _setting(
    record: Record, masked: Mapping[str, BoolArray], rig: Rig, shape: FittedShape
) -> tuple[LinearSetting, LinearState]:
    """Return the constants of all rounds, and the state where the quick fit ended."""
    start = float(record["command"].t[0])
    record = replace(record, channels={n: c for n, c in record.channels.items() if n != "motor_torque"})
    begin, end = _liveliest(record, masked)
    record, masked = _cut(record, masked, begin, end)
    informative = channels_that_tell(record, rig)
    sensed = [n for n in SENSED if n in informative]  # a held motor torque shows no clock
    values = unknowns_of_rig(rig)
    theta = np.array([u.inner(shape.values.get(u.name, u.start)) for u in values])

    def start_state(timed: Sequence[str]) -> LinearState:
        return LinearState(theta, np.array([shape.delay.get(n, 0.0) for n in timed]), np.zeros(len(timed)))

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
        settled = _clocks_stand(setting, step, sd)
        if settled:
            break
    return state.move(0.5 * step), rows, sd, settled


def _clocks_stand(setting: LinearSetting, step: FloatArray, sd: FloatArray) -> bool:
    """Return whether a step leaves every clock unchanged within its doubt."""
    n, m = len(setting.values), len(setting.timed)
    finest = np.repeat([_RESOLUTION, _RESOLUTION / setting.case.duration], m)
    clocks = slice(n, n + 2 * m)
    return bool(np.all(np.abs(step[clocks]) < _DONE * np.hypot(sd[clocks], finest)))


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


def _cut(
    record: Record, masked: Mapping[str, BoolArray], begin: float, end: float
) -> tuple[Record, dict[str, BoolArray]]:
    """Return record and masks between two instants (s), as they are where that is all of them."""
    inside = {n: (c.t >= begin) & (c.t < end) for n, c in record.channels.items()}
    return record.between(begin, end), {n: masked[n][keep] for n, keep in inside.items() if n in masked}


def _linear(
    setting: LinearSetting, state: LinearState, rows: LinearisedRows, sd: FloatArray, settled: bool
) -> LinearisedFit:
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
