"""Stages: the accepted models one after another, re-fitted on all that does not judge, and judged."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

from rsea_ros.checks.faults import Checked
from rsea_ros.diagnosis.candidate import Candidate, fit_candidate, score_again
from rsea_ros.diagnosis.data_split import TEST, TRAIN, VALIDATION, Score, score, score_on
from rsea_ros.diagnosis.stepwise import Selection
from rsea_ros.identification.confidence import Confidence, confidence_of
from rsea_ros.identification.problem import case_from, simulated
from rsea_ros.identification.solver import Map, Solution
from rsea_ros.identification.unknowns import apply
from rsea_ros.model.record_phase import in_phase
from rsea_ros.model.rig import Rig
from rsea_ros.signals import FloatArray

_GAIN = 1e-6
"""Relative fall of the cost, at the noise, below which a fit is done."""


@dataclass(frozen=True)
class Evaluated:
    """A model of the accepted sequence, re-fitted on all blocks but those that judge, and judged there."""

    solution: Solution
    outputs: list[dict[str, FloatArray]]
    train: Score
    test: Score

    @cached_property
    def confidence(self) -> Confidence:
        """How sure the fit is."""
        return confidence_of(self.solution)


def evaluate(
    selection: Selection, chosen: Candidate, judging: Checked | None, rig: Rig, run: Map
) -> Evaluated:
    """Re-fit a model on all that does not judge, and judge it."""
    start, weights = chosen.solution, score_again(selection.cases, chosen).validation
    places = (*TRAIN, *VALIDATION)
    model = fit_candidate(
        selection.cases, start.problem, start.theta, places, weights=weights, gain=_GAIN, run=run
    )
    problem = model.solution.problem
    train = score_on(problem, selection.cases, places, model.outputs)
    if judging is None:
        test = score_on(problem, selection.cases, TEST, model.outputs)
        return Evaluated(model.solution, model.outputs, train, test)
    case = replace(case_from(judging.record, rig, judging.masked), noise=selection.cases[0].noise)
    moved, offsets = apply(problem.rig, problem.unknowns, model.solution.theta)
    moved = in_phase(moved, judging.record)
    outputs = simulated((case,), moved, offsets, ride=problem.ride)
    return Evaluated(model.solution, model.outputs, train, score(problem, (case,), outputs))
