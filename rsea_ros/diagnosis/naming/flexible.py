"""A flexible law of the same regressors: its further gain beside a cause, whose contribution is taken out.

Beside the named law a small spline over its regressor (speed, deflection, command, the measured torque)
acts at the same place. If the named law is right, the spline gains nothing; a law that the
catalogue lacks leaves it a gain. Fitted linearly, with all other unknowns, on all blocks but the test blocks.

The responses to the spline's parts are simulated: a torque at the gear or in the spring is a torque beside
the command, one in the spring also shows in the F/T sensor, and a sensor's own error adds to its channel.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from rsea_ros.diagnosis.candidate import in_units_of, without_effect
from rsea_ros.diagnosis.data_split import TEST, blocks_of, set_of
from rsea_ros.diagnosis.score import Score, gain_of
from rsea_ros.diagnosis.settings import BlockSettings, DiagnosisSettings
from rsea_ros.effects import signal_table as st
from rsea_ros.effects.catalogue import effect_named
from rsea_ros.effects.effect import Effect
from rsea_ros.identification.problem import Case, Problem
from rsea_ros.identification.solver import Map, jacobian_columns, power, serial
from rsea_ros.model.drive import Drive
from rsea_ros.records.record import BoolArray, FloatArray, IntArray


@dataclass(frozen=True)
class ContributionRows:
    """The weighted residuals of a model and the contribution of one cause, row by row, shape (m,).

    others: derivatives by all unknowns but the cause's, shape (m, n). block: number of a row's block, tests:
    whether it takes part in no fit and no choice. runs: rows of one channel of one record, in time.
    """

    contribution: FloatArray
    residual: FloatArray
    others: FloatArray
    prior: FloatArray
    block: IntArray
    tests: BoolArray
    runs: tuple[slice, ...]


def weight_by(problem: Problem, cases: Sequence[Case], weights: Score) -> Problem:
    """Return a problem on all samples of the cases, each channel in units of its residual in `weights`."""
    return replace(problem, cases=in_units_of(weights, cases))


_LEAST_CONTRIBUTION = 1e-5
"""Power of a contribution over that of the residual below which a cause changes nothing: it lowers the
residual's power by no more than its contribution's, and the least gain that is named is 100 times as much."""


def rows_of(
    problem: Problem, theta: FloatArray, name: str, settings: DiagnosisSettings, run: Map = serial
) -> ContributionRows | None:
    """Return a model's residuals and the contribution of one cause.

    None where a simulation diverges, and for a cause that changes nothing: what its model gains, a better fit
    of the other unknowns gains too.
    """
    error = problem.residual(theta)
    less, rest = without_effect(problem, theta, name)
    without = less.residual(rest)
    if not np.isfinite(power(error)) or not np.isfinite(power(without)):
        return None
    contribution = error - without
    if power(contribution) < _LEAST_CONTRIBUTION * power(error):
        return None
    which = [i for i, u in enumerate(problem.unknowns) if not u.name.startswith(name + ".")]
    block, tests, runs = _blocks_of_rows(problem, settings.blocks)
    return ContributionRows(
        contribution=contribution, residual=-error,
        others=jacobian_columns(problem, theta, error, which, run),
        prior=np.array([1.0 / problem.unknowns[i].reach for i in which]), block=block, tests=tests,
        runs=runs,
    )


def _blocks_of_rows(
    problem: Problem, rule: BlockSettings
) -> tuple[IntArray, BoolArray, tuple[slice, ...]]:
    """Return for every row its block, numbered through all records, and whether it tests; and the runs."""
    blocks, tests, runs, first_block, row = [], [], [], 0, 0
    for case in problem.cases:
        last_block = 0
        for n in problem.present(case):
            block = blocks_of(case, n, rule)[case.mask[n]]
            blocks.append(first_block + block)
            tests.append(np.isin(set_of(block), TEST))
            runs.append(slice(row, row + len(block)))
            row, last_block = row + len(block), max(last_block, int(block.max(initial=0)))
        first_block += last_block + 1
    return np.concatenate(blocks), np.concatenate(tests), tuple(runs)


def project_out(rows: ContributionRows, values: FloatArray) -> FloatArray:
    """Return rows of values less their best fit by the other unknowns."""
    a = rows.others
    normal = a.T @ a + np.diag(rows.prior**2)
    return np.asarray(values - a @ np.linalg.lstsq(normal, a.T @ values, rcond=None)[0])


_KNOTS = (0.0, 0.1, 0.25, 0.5, 0.75, 0.9, 1.0)
"""Quantiles of a regressor's size between which the law is straight, each sign for itself: finer at both
ends, where friction and stops act. Fixed, as the lags, when the coefficients of status.py were fitted."""
_LAGS = (1, 2, 4, 8)
"""Samples by which the law looks back, for a cause that is a time: doubling, to 29 ms at 280 Hz."""
_RIDGE = 1e-6
"""Of each column's power: keeps parts of the spline apart that the data do not. Numerical: a thousandth of a
column's size."""
_STEP = 1e-2
"""Of the largest command: torque at which the responses are taken. Numerical: small, so that they are linear,
and far above rounding."""


@dataclass(frozen=True)
class Flexible:
    """The gain of the spline: share of the residual on test blocks, and its 95 % interval."""

    gain: float
    ci95: tuple[float, float]


def flexible(
    problem: Problem, theta: FloatArray, name: str, rows: ContributionRows, settings: DiagnosisSettings
) -> Flexible | None:
    """Return the gain of a spline beside a cause; None for a cause without a suitable regressor."""
    responses = _responses(problem, theta, effect_named(name))
    if not responses:
        return None
    matrix = np.column_stack([*responses, rows.others])
    del responses  # of a long record they are as large as the matrix
    size = np.sqrt(np.sum(matrix**2, axis=0))
    matrix = matrix[:, size > 0.0]
    matrix /= size[size > 0.0]
    fits = ~rows.tests
    normal = matrix[fits].T @ matrix[fits] + _RIDGE * np.eye(matrix.shape[1])
    weights = np.linalg.lstsq(normal, matrix[fits].T @ rows.residual[fits], rcond=None)[0]
    before, after = (_by_block(rows, v) for v in (rows.residual, rows.residual - matrix @ weights))
    return Flexible(*gain_of(after, before, settings.acceptance.resamples))


def _by_block(rows: ContributionRows, values: FloatArray) -> FloatArray:
    """Return the power of values in each test block."""
    power = np.bincount(rows.block, values**2 * rows.tests)
    return np.asarray(power[np.bincount(rows.block, rows.tests) > 0], np.float64)


def _responses(problem: Problem, theta: FloatArray, effect: Effect) -> list[FloatArray]:
    """Return the weighted responses of all rows to each part of the spline, shape (m,) each."""
    base = problem.outputs(theta)
    signals = [_signal(c, out, effect) for c, out in zip(problem.cases, base, strict=True)]
    if any(s is None for s in signals):
        return []
    parts = [
        _spline(s, effect, c.drive.hold if isinstance(c.drive, Drive) else 1, _spans(c, s))
        for s, c in zip(signals, problem.cases, strict=True)
        if s is not None
    ]
    zero = problem.residual_of(base)
    contributions = ([make() for make in alike] for alike in zip(*parts, strict=False))
    return [problem.residual_of(_with_part(problem, theta, base, effect, p)) - zero for p in contributions]


def _spans(case: Case, signal: FloatArray) -> Sequence[tuple[int, int]]:
    """Return the parts of a signal that are simulated: all of one at the samples of a channel."""
    drive = case.drive
    on_steps = isinstance(drive, Drive) and len(signal) == len(drive.command)
    return drive.simulated if isinstance(drive, Drive) and on_steps else ((0, len(signal)),)


def _signal(case: Case, out: dict[str, FloatArray], effect: Effect) -> FloatArray | None:
    """Return the effect's regressor, on the drive's steps or at the samples of the channel it adds to."""
    drive = case.drive
    if effect.port is st.Port.SENSOR:
        return out.get(effect.sensor)
    if not isinstance(drive, Drive):
        if effect.port is st.Port.SPRING:
            return drive.d if len(drive.d) else None
        return drive.v if st.GEAR_VELOCITY in effect.reads else None
    if effect.port in (st.Port.COMMAND, st.Port.MOTOR):
        return drive.command
    middles = drive.start + drive.step * (np.arange(len(drive.command)) + 0.5)
    if st.GEAR_VELOCITY in effect.reads and "velocity" in out:
        return np.asarray(np.interp(middles, case.t["velocity"], out["velocity"]))
    if st.GEAR_VELOCITY in effect.reads and "position" in out:
        t = case.t["position"]
        return np.asarray(np.interp(middles, t, np.gradient(out["position"], t)))
    read = next((n for n in ("position", "ft") if n in out), None)
    if effect.port is not st.Port.SPRING or read is None:
        return None
    return np.asarray(np.interp(middles, case.t[read], out[read]))


def _spline(
    signal: FloatArray, effect: Effect, hold: int, spans: Sequence[tuple[int, int]]
) -> list[Callable[[], FloatArray]]:
    """Return what makes each part of the spline along a signal: hats over its size, by sign, or its past.

    spans: parts of the signal that count. One part of a long record is large: all at once are too many.
    """
    if effect.main.unit in ("s", "Hz") and effect.port in (st.Port.COMMAND, st.Port.SENSOR):
        step = hold if effect.port is st.Port.COMMAND else 1
        return [partial(_since, signal, k * step) for k in _LAGS]
    size = np.abs(signal)
    knots = np.unique(np.quantile(np.concatenate([size[a:b] for a, b in spans]), _KNOTS))
    if len(knots) < 2:
        return []
    return [partial(_hat, signal, side, knots, k) for side in (1.0, -1.0) for k in range(len(knots))]


def _since(signal: FloatArray, samples: int) -> FloatArray:
    """Return a signal some samples ago minus the signal now."""
    return np.concatenate([np.full(samples, signal[0]), signal[:-samples]]) - signal


def _hat(signal: FloatArray, side: float, knots: FloatArray, k: int) -> FloatArray:
    """Return the hat at a knot over the size of a signal where its sign is that of `side`, zero elsewhere."""
    hat = np.interp(np.abs(signal), knots, np.eye(len(knots))[k])
    return np.asarray(hat * (side * signal > 0.0))


def _with_part(
    problem: Problem, theta: FloatArray, base: Sequence[dict[str, FloatArray]], effect: Effect,
    parts: Sequence[FloatArray],
) -> list[dict[str, FloatArray]]:  # fmt: skip
    """Return the channels with one part of the spline acting where the effect does."""
    if effect.port is st.Port.SENSOR:
        seen = effect.sensor
        return [{**out, seen: out[seen] + part} for out, part in zip(base, parts, strict=True)]
    drives = [c.drive for c in problem.cases]
    if not all(isinstance(d, Drive) for d in drives):
        both = {"motor_torque", "ft"} if effect.port is st.Port.SPRING else {"motor_torque"}
        return [{n: y + p * (n in both) for n, y in o.items()} for o, p in zip(base, parts, strict=True)]
    size = _STEP * max(float(np.max(np.abs(d.command))) for d in drives if isinstance(d, Drive))
    pushed = [
        replace(d, command=d.command + size * p / max(float(np.max(np.abs(p))), 1e-300))
        for d, p in zip(drives, parts, strict=True)
        if isinstance(d, Drive)
    ]
    cases = tuple(replace(c, drive=d) for c, d in zip(problem.cases, pushed, strict=True))
    outputs = replace(problem, cases=cases).outputs(theta)
    if effect.port is not st.Port.COMMAND:
        unchanged = ({n: y for n, y in b.items() if n == "motor_torque"} for b in base)
        outputs = [{**o, **kept} for o, kept in zip(outputs, unchanged, strict=True)]
    if effect.port is st.Port.SPRING:
        outputs = [_with_ft_torque(c, o, d) for c, o, d in zip(problem.cases, outputs, pushed, strict=True)]
    return outputs


def _with_ft_torque(case: Case, out: dict[str, FloatArray], pushed: Drive) -> dict[str, FloatArray]:
    """Return channels in which the F/T sensor also measures the torque taken from the spring's."""
    if "ft" not in out or not isinstance(case.drive, Drive):
        return out
    middles = pushed.start + pushed.step * (np.arange(len(pushed.command)) + 0.5)
    return {**out, "ft": out["ft"] - np.interp(case.t["ft"], middles, pushed.command - case.drive.command)}
