"""Evaluation: the accepted models, each re-fitted on all blocks but the test blocks and scored on those."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

from rsea_ros.checks.faults import Checked
from rsea_ros.diagnosis.candidate import Candidate, FitSetup, fit_candidate
from rsea_ros.diagnosis.data_split import TEST, TRAIN, VALIDATION
from rsea_ros.diagnosis.score import Score, score, score_on
from rsea_ros.diagnosis.selection import Selection
from rsea_ros.diagnosis.settings import DiagnosisSettings
from rsea_ros.identification.confidence import Confidence, confidence_of
from rsea_ros.identification.problem import case_from, simulated
from rsea_ros.identification.solver import Solution
from rsea_ros.identification.unknowns import apply
from rsea_ros.identification.workers import Pools
from rsea_ros.model.record_phase import in_phase
from rsea_ros.model.rig import Rig
from rsea_ros.signals import FloatArray


@dataclass(frozen=True)
class Evaluated:
    """A model of the selection as it is reported.

    train: its score on the blocks that it was fitted to. test: on the test blocks, or on the held-out record.
    """

    solution: Solution
    outputs: list[dict[str, FloatArray]]
    train: Score
    test: Score

    @property
    def added(self) -> str:
        """Name of the effect that the model adds to the one before; empty for the nominal model."""
        added = self.solution.problem.added
        return added[-1] if added else ""

    @cached_property
    def confidence(self) -> Confidence:
        """The doubt that is left of the fit's values."""
        return confidence_of(self.solution)


def evaluate(
    selection: Selection,
    chosen: Candidate,
    holdout: Checked | None,
    pools: Pools,
    settings: DiagnosisSettings,
) -> Evaluated:
    """Re-fit a model to the training and validation blocks, and score it on the test blocks.

    holdout: a record that takes the place of the test blocks.
    """
    cases, blocks = selection.cases, (*TRAIN, *VALIDATION)
    setup = FitSetup(
        cases, settings, pools.run, chosen.validation, blocks=blocks, gain=settings.fits.final_gain
    )
    model = fit_candidate(setup, chosen.problem, chosen.solution.theta)
    train = score_on(model.problem, cases, blocks, model.outputs, settings.blocks)
    if holdout is None:
        test = score_on(model.problem, cases, TEST, model.outputs, settings.blocks)
    else:
        test = _score(model, holdout, selection.models[0].problem.rig)
    return Evaluated(model.solution, model.outputs, train, test)


def _score(model: Candidate, holdout: Checked, nominal: Rig) -> Score:
    """Return the score of a model on all of a held-out record."""
    problem = model.problem
    case = replace(case_from(holdout.record, nominal, holdout.masked), noise=model.cases[0].noise)
    rig, offsets = apply(problem.rig, problem.unknowns, model.solution.theta)
    outputs = simulated((case,), in_phase(rig, holdout.record), offsets, ride=problem.ride)
    return score(problem, (case,), outputs, model.settings.blocks)
