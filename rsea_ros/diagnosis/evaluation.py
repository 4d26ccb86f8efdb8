"""Stages: the accepted models one after another, re-fitted on all that does not judge, and judged."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from rsea_ros.checks.faults import Checked
from rsea_ros.diagnosis.candidate import Model, fitted, rescored
from rsea_ros.diagnosis.data_split import CHOOSE, FIT, JUDGE, Score, score, score_on
from rsea_ros.diagnosis.stepwise import Search
from rsea_ros.identification.confidence import Confidence, confidence_of
from rsea_ros.identification.problem import case_from, simulated
from rsea_ros.identification.solver import Map, Solution
from rsea_ros.identification.unknowns import apply
from rsea_ros.model.record_phase import in_phase
from rsea_ros.model.rig import Rig
from rsea_ros.signals import FloatArray, Record

_GAIN = 1e-6
"""Relative fall of the cost, at the noise, below which a fit is done."""


@dataclass(frozen=True)
class Stage:
    """A model of the accepted sequence, re-fitted on all blocks but those that judge, and judged there."""

    solution: Solution
    outputs: list[dict[str, FloatArray]]
    train: Score
    judged: Score

    @cached_property
    def confidence(self) -> Confidence:
        """How sure the fit is."""
        return confidence_of(self.solution)


def effect_added(stage: Stage) -> str:
    """Return the name of the effect that a stage adds to the one before."""
    return stage.solution.problem.rig.effects[-1].name


@dataclass(frozen=True)
class Examined:
    """All that a conclusion is drawn from: the search, its models judged, and the data.

    checked: the records as checked. judging: the held-out record, where one was given.
    """

    found: Search
    stages: list[Stage]
    checked: Sequence[Checked]
    judging: Checked | None
    records: Sequence[Record]
    rig: Rig


def judged(found: Search, chosen: Model, judging: Checked | None, rig: Rig, run: Map) -> Stage:
    """Re-fit a model on all that does not judge, and judge it."""
    start, weights = chosen.solution, rescored(found.cases, chosen).choose
    places = (*FIT, *CHOOSE)
    model = fitted(found.cases, start.problem, start.theta, places, weights=weights, gain=_GAIN, run=run)
    problem = model.solution.problem
    train = score_on(problem, found.cases, places, model.outputs)
    if judging is None:
        on_judge = score_on(problem, found.cases, JUDGE, model.outputs)
        return Stage(model.solution, model.outputs, train, on_judge)
    case = replace(case_from(judging.record, rig, judging.masked), noise=found.cases[0].noise)
    moved, offsets = apply(problem.rig, problem.unknowns, model.solution.theta)
    moved = in_phase(moved, judging.record)
    outputs = simulated((case,), moved, offsets, ride=problem.ride)
    return Stage(model.solution, model.outputs, train, score(problem, (case,), outputs))
