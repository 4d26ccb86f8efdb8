"""The base model whose residual is looked at, fitted to all blocks but the test blocks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rsea_ros.checks.faults import check
from rsea_ros.diagnosis.data_split import TEST, TRAIN, VALIDATION, part
from rsea_ros.diagnosis.diagnose import nominal_problem
from rsea_ros.diagnosis.score import Score, score_on
from rsea_ros.diagnosis.settings import DEFAULT
from rsea_ros.identification.fit import fit
from rsea_ros.identification.joint_start import joint_start
from rsea_ros.identification.noise_level import reestimate_noise
from rsea_ros.identification.problem import Case, Problem
from rsea_ros.identification.solver import Solution
from rsea_ros.identification.steady import with_even_clocks
from rsea_ros.model.extent import bound_values
from rsea_ros.model.position_loop import with_command
from rsea_ros.model.rig import Rig
from rsea_ros.records.record import FloatArray, Record

FITTED = (*TRAIN, *VALIDATION)


@dataclass(frozen=True)
class Base:
    """The model whose residual is looked at, fitted to all blocks but the test blocks. cases: all samples."""

    solution: Solution
    cases: tuple[Case, ...]
    outputs: list[dict[str, FloatArray]]

    @property
    def problem(self) -> Problem:
        """The base model on all samples."""
        return replace(self.solution.problem, cases=self.cases)

    def score(self, sets: tuple[int, ...]) -> Score:
        """Return the base's score on some sets of blocks."""
        return score_on(self.problem, self.cases, sets, self.outputs, DEFAULT.blocks)


def fitted_base(records: Sequence[Record], rig: Rig) -> Base:
    """Fit a rig to all blocks of records but the test blocks."""
    rig = rig.with_effects(*(e for e in rig.effects if not e.guess))
    records = [bound_values(with_command(r, rig)) for r in records]
    checked = [check(r, rig) for r in records]
    steady = with_even_clocks([c.record for c in checked], [c.masked for c in checked], rig)
    checked = [replace(c, record=r) for c, r in zip(checked, steady.records, strict=True)]
    problem = nominal_problem(checked, rig)
    parts = [part(c, FITTED, DEFAULT.blocks) for c in problem.cases]
    start = joint_start(checked[0].record, rig) if rig.loop is not None else None
    solution = fit(parts, rig, start=start)[0]
    whole = replace(solution.problem, cases=problem.cases)
    outputs = whole.outputs(solution.theta)
    return Base(solution, _with_noise(whole, outputs), outputs)


def _with_noise(problem: Problem, outputs: Sequence[dict[str, FloatArray]]) -> tuple[Case, ...]:
    """Return the cases with the noise that the base's residual shows, as a diagnosis estimates it."""
    ratio = problem.rig["gear.ratio"]
    return tuple(reestimate_noise(c, out, ratio) for c, out in zip(problem.cases, outputs, strict=True))


def levels_of(
    problem: Problem, outputs: Sequence[dict[str, FloatArray]], cases: Sequence[Case]
) -> tuple[dict[str, float], dict[str, float]]:
    """Return the RMS of each channel's residual on the test blocks, and its noise."""
    score = score_on(problem, cases, TEST, list(outputs), DEFAULT.blocks)
    noise = {n: float(np.mean([c.noise[n] for c in cases if n in c.noise])) for n in score.sums}
    return {n: score.ratio(n) * noise[n] for n in score.sums}, noise
