"""How far a fit is from the noise, and the weights that follow."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from rsea_ros.identification.problem import Case, Problem, weighted_residual
from rsea_ros.identification.solver import Solution
from rsea_ros.records.record import FloatArray


def misfit_ratios(solution: Solution) -> dict[str, float]:
    """Return by channel the RMS of a solution's residual over its noise: 1 where it is at the noise."""
    problem = solution.problem
    return ratios_of(problem, problem.cases, problem.outputs(solution.theta))


def ratios_of(
    problem: Problem, cases: Sequence[Case], outputs: Sequence[Mapping[str, FloatArray]]
) -> dict[str, float]:
    """Return by channel the RMS of the residual over its noise: 1 where it is at the noise."""
    parts: dict[str, list[FloatArray]] = {}
    for case, out in zip(cases, outputs, strict=True):
        for n in problem.present(case):
            parts.setdefault(n, []).append(weighted_residual(case, out, [n]))
    return {n: float(np.sqrt(np.mean(np.concatenate(p) ** 2))) for n, p in parts.items()}


def reweight(case: Case, ratios: Mapping[str, float]) -> Case:
    """Return a case in which the residual of a channel counts as its noise, where it is larger."""
    return replace(case, noise={n: s * max(1.0, ratios.get(n, 1.0)) for n, s in case.noise.items()})
