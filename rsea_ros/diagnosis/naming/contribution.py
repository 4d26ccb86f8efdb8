"""The contribution of one cause to a model's channels, row by row, beside the residual."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rsea_ros.diagnosis.data_split import TEST, blocks_of, set_of
from rsea_ros.diagnosis.problem_variants import in_units_of, without_effect
from rsea_ros.diagnosis.score import Score
from rsea_ros.diagnosis.settings import BlockSettings, DiagnosisSettings
from rsea_ros.identification.problem import Case, Problem
from rsea_ros.identification.solver import Map, jacobian_columns, power, serial
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
    if power(contribution) < settings.evidence.least_contribution * power(error):
        return None
    which = [i for i, u in enumerate(problem.unknowns) if not u.name.startswith(name + ".")]
    block, tests, runs = _blocks_of_rows(problem, settings.blocks)
    return ContributionRows(
        contribution=contribution,
        residual=-error,
        others=jacobian_columns(problem, theta, error, which, run),
        prior=np.array([1.0 / problem.unknowns[i].reach for i in which]),
        block=block,
        tests=tests,
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
