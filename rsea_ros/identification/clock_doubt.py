"""The contribution of an even clock's doubt to the doubt of a fit.

The zero of an even clock through n stamps of scatter s is known to s / sqrt(n). A clock off by d moves a fit
by -H^-1 J' c d, with c = d r / d clock. Channels of one message share a clock; a late command is an
early sensor, all of them together.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from rsea_ros.identification.confidence import Confidence, inverse_of
from rsea_ros.identification.problem import Problem
from rsea_ros.identification.solver import Solution, clock_columns
from rsea_ros.identification.unknowns import clocks
from rsea_ros.records.record import FloatArray, Record


def with_even_clocks(
    confidence: Confidence, solution: Solution, stamped: Sequence[Record], even: Sequence[Record]
) -> Confidence:
    """Return the confidence of a fit to records on even clocks, their doubt included.

    stamped: the same records with the stamps that they came with.
    """
    moved = list(_clock_sensitivities(solution, stamped, even))
    if not moved:
        return confidence
    prior = np.diag([u.reach**-2 for u in solution.problem.unknowns])
    steps = inverse_of(confidence.information + prior) @ solution.jacobian.T @ np.column_stack(moved)
    return replace(confidence, covariance=confidence.covariance + steps @ steps.T)


def _clock_sensitivities(
    solution: Solution, stamped: Sequence[Record], even: Sequence[Record]
) -> Iterator[FloatArray]:
    """Yield the change of the residual by one sigma of each even clock, shape (m,)."""
    problem = solution.problem
    doubts = [_doubts(before, after) for before, after in zip(stamped, even, strict=True)]
    if not any(doubts):
        return
    columns = _columns(solution)
    of = _case_of(problem)
    for k, groups in enumerate(doubts):
        for names, doubt in groups:
            chosen = columns if "command" in names else columns.keys() & set(names)
            yield np.where(of == k, doubt * sum(columns[n] for n in chosen), 0.0)


def _columns(solution: Solution) -> dict[str, FloatArray]:
    """Return d residual / d clock by channel, shape (m,)."""
    problem = solution.problem
    measured = [n for n in problem.channels if any(n in case.measured for case in problem.cases)]
    timed = [n for n in measured if n != "motor_torque"]
    columns = clock_columns(problem, solution.theta, clocks(timed, problem.rig))
    return dict(zip(timed, columns.T, strict=True))


def _case_of(problem: Problem) -> FloatArray:
    """Return the number of the case of every residual."""
    numbers = {id(case): float(k) for k, case in enumerate(problem.cases)}
    return problem.by_row(lambda case, n: numbers[id(case)])


def _doubts(stamped: Record, even: Record) -> list[tuple[tuple[str, ...], float]]:
    """Return the channels that share an even clock, and one sigma of its zero, s."""
    groups: dict[bytes, list[str]] = {}
    for n in stamped.channels.keys() & even.channels.keys():
        if not np.array_equal(stamped[n].t, even[n].t):
            groups.setdefault(stamped[n].t.tobytes(), []).append(n)
    return [(tuple(names), _doubt(stamped[names[0]].t, even[names[0]].t)) for names in groups.values()]


def _doubt(t: FloatArray, even: FloatArray) -> float:
    return float(np.std(t - even)) / float(np.sqrt(len(t)))
