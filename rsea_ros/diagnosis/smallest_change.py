"""The smallest change of a machine that its recording would have shown: how one knows that the alarm works.

Each effect that a diagnosis tries is put into the model with which it ended, and grows until a channel's
residual is `floor.only_noise` times its noise although every value of the fit answers it, to first order: up
to there a search ends before it begins. What a fit answers wholly (a motor constant, where only the angle is
measured) shows at no size. A change half as large again is found and named (decision 342 has how often).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import orth

from rsea_ros.checks.faults import check
from rsea_ros.diagnosis.diagnose import nominal_problem, searched_effects
from rsea_ros.diagnosis.result import Diagnosis, SmallestChange
from rsea_ros.effects.effect import Effect, Parameter
from rsea_ros.errors import ParameterError, RseaError
from rsea_ros.identification.fit import add_effect
from rsea_ros.identification.problem import Problem
from rsea_ros.identification.solver import jacobian, solve, worker_pools
from rsea_ros.identification.unknowns import CLOCK_REACH
from rsea_ros.model.extent import bound_values
from rsea_ros.model.position_loop import with_command
from rsea_ros.records.record import FloatArray, IntArray, Record

_CLOSE, _ROUNDS, _STRAIGHT = 0.02, 20, 6
"""Relative error of a size at which it is near enough; sizes tried until then, first by a straight line."""
_SPAN = 1e-6, 1e4
"""Shares of an effect's typical size between which one is looked for."""


def smallest_changes(diagnosis: Diagnosis, records: Sequence[Record]) -> tuple[SmallestChange, ...]:
    """Return the smallest size of each effect that records of a diagnosis would have shown.

    records: those that were diagnosed. Causes and effects that the model has are left out.
    """
    rig, settings = diagnosis.extended_rig, diagnosis.settings
    checked = [check(bound_values(with_command(r, rig)), rig) for r in records]
    problem = nominal_problem(checked, rig, settings)
    with worker_pools() as pools:
        end = solve(problem, iterations=12, run=pools.run)
        names = sorted(problem.channels)
        rows = problem.by_row(lambda case, channel: names.index(channel)).astype(np.int64)
        matrix = jacobian(problem, end.theta, end.residual, pools.run)
        answers = _answers(problem, matrix, by_clocks=False), _answers(problem, matrix, by_clocks=True)
        model = _Model(problem, end.theta, rows, answers)
        effects = [e for e in searched_effects(problem, settings.without) if e.name not in problem.acting]
        limit = settings.floor.only_noise
        found = pools.fits.map(lambda effect: _smallest(effect, model, limit), effects)
        return tuple(change for change in found if change is not None)


def _answers(problem: Problem, matrix: FloatArray, *, by_clocks: bool) -> FloatArray:
    """Return b: values of a fit, clocks if by_clocks, leave change - b @ b.T @ change of its residuals."""
    values = [k for k, u in enumerate(problem.unknowns) if by_clocks or not u.is_clock]
    priors = np.diag([1.0 / problem.unknowns[k].doubt for k in values])
    columns = np.vstack([matrix[:, values], priors])
    size = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    return np.asarray(orth(columns / size, rcond=1e-7))[: len(matrix)]


@dataclass(frozen=True)
class _Model:
    """A fitted model. channels: number of that of each residual; answers: without clocks, with them."""

    problem: Problem
    theta: FloatArray
    channels: IntArray
    answers: tuple[FloatArray, FloatArray]

    def shown(self, change: FloatArray, *, by_clocks: bool) -> float:
        """Return the largest ratio of residual to noise in a channel, of a change that the values answer."""
        answer = self.answers[by_clocks]
        left = change - answer @ (answer.T @ change)
        power = np.bincount(self.channels, left**2) / np.maximum(np.bincount(self.channels), 1)
        return math.sqrt(1.0 + float(np.max(power))) if np.isfinite(power).all() else math.inf


def _smallest(effect: Effect, model: _Model, limit: float) -> SmallestChange | None:
    """Return the size of an effect that a model shows at a limit: its residual grows with the size.

    None for one that the machine cannot have.
    """
    size = size_of(effect)
    share, low, high, is_time = 1.0, *_SPAN, size.unit == "s"
    value = math.nan

    def added(share: float) -> tuple[Problem, FloatArray]:
        return add_effect(model.problem, model.theta, effect, of_size(effect, size, share))

    # a lag reads the current otherwise, however short
    without, at = added(_SPAN[0]) if is_time else (model.problem, model.theta)
    before = without.residual(at)
    for k in range(_ROUNDS):
        parameters = of_size(effect, size, share)
        try:
            problem, theta = added(share)
            power = model.shown(problem.residual(theta) - before, by_clocks=not is_time) ** 2 - 1.0
        except ParameterError:
            return None
        except RseaError:
            power = math.inf
        value, wanted = parameters[size.name], limit**2 - 1.0
        if abs(math.sqrt(power / wanted) - 1.0) < _CLOSE:
            break
        low, high = (share, high) if power < wanted else (low, share)
        nearer = share * math.sqrt(wanted / power) if 0.0 < power < math.inf and k < _STRAIGHT else 0.0
        share = nearer if low < nearer < high else math.sqrt(low * high)
    else:
        value = math.nan
    if is_time:  # as far as the clocks go, they are the answer
        value += CLOCK_REACH * min(model.problem.rig.clock_doubt(n) for n in model.problem.channels)
    return SmallestChange(effect.name, size.name, value, size.unit)


def size_of(effect: Effect) -> Parameter:
    """Return the parameter at whose null an effect vanishes: its size."""
    return next(p for p in effect.parameters if p.null != p.typical)


def of_size(effect: Effect, size: Parameter, share: float) -> dict[str, float]:
    """Return parameters of an effect of a share of its typical size; its form stays the typical one."""
    return {
        p.name: _part(p, share) if p is size or not (p.logarithmic or p.null == p.typical) else p.typical
        for p in effect.parameters
    }


def _part(p: Parameter, share: float) -> float:
    value = p.typical / share if math.isinf(p.null) else p.null + share * (p.typical - p.null)
    return min(max(value, p.low), p.high)
