"""A selection of causes, and its evaluation on blocks that took no part."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

from rsea_ros.checks.faults import Checked
from rsea_ros.diagnosis.candidate import LAST_GAIN, Candidate, FitSetup, fit_candidate
from rsea_ros.diagnosis.data_split import TEST, TRAIN, VALIDATION
from rsea_ros.diagnosis.result import Reason
from rsea_ros.diagnosis.score import Score, score, score_on
from rsea_ros.diagnosis.settings import DiagnosisSettings
from rsea_ros.diagnosis.stretches import spread_over
from rsea_ros.identification.confidence import Confidence, confidence_of
from rsea_ros.identification.problem import Case, Problem, case_from, simulate_cases
from rsea_ros.identification.solver import Pools, Solution
from rsea_ros.identification.unknowns import apply
from rsea_ros.model.prediction_errors import in_phase
from rsea_ros.model.rig import Rig
from rsea_ros.records.record import Fault, FloatArray, Record


@dataclass(frozen=True)
class Trial:
    """An effect tried beside a model. problem, theta: with it, at the end of its fit.

    is_full: fitted to all training blocks, not only to short pieces. rival: the effect that was preferred.
    """

    name: str
    beside: Candidate
    problem: Problem
    theta: FloatArray
    is_full: bool
    reason: Reason
    rival: str = ""


def trial_of(model: Candidate, name: str, beside: Candidate, reason: Reason, rival: str = "") -> Trial:
    """Return the trial of an effect that was fitted to all training blocks."""
    return Trial(name, beside, model.problem, model.solution.theta, True, reason, rival)


@dataclass(frozen=True)
class Selection:
    """The accepted models, from the nominal one on, and other trials.

    contenders: by accepted cause, what was fitted in its place beside all the other causes.
    """

    models: tuple[Candidate, ...]
    trials: tuple[Trial, ...] = ()
    contenders: Mapping[str, tuple[Trial, ...]] = field(default_factory=dict)

    @property
    def cases(self) -> tuple[Case, ...]:
        """Every sample of the records, with the noise by the last model."""
        return self.last.cases

    @property
    def last(self) -> Candidate:
        """The model with all accepted causes."""
        return self.models[-1]


@dataclass(frozen=True)
class Examined:
    """The input of a diagnosis: the records as read and as checked, the held-out one as checked, the rig."""

    records: Sequence[Record]
    checked: Sequence[Checked]
    holdout: Checked | None
    rig: Rig

    @property
    def faults(self) -> tuple[Fault, ...]:
        """The faults of all records, the held-out one last."""
        every = [*self.checked, *([self.holdout] if self.holdout is not None else [])]
        return tuple(fault for checked in every for fault in checked.faults)

    @property
    def rate(self) -> float:
        """The rate of the commands, Hz, stamps that repeat aside."""
        return self.checked[0].record["command"].rate


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
        return self.solution.problem.newest

    @cached_property
    def confidence(self) -> Confidence:
        """The doubt that is left of the fit's values."""
        return confidence_of(self.solution)


@dataclass(frozen=True)
class HeldOut:
    """The data that test models: the test blocks of the cases, or a record in their place.

    nominal: the rig without causes, by which the record is prepared. settings: how records are cut.
    """

    cases: tuple[Case, ...]
    nominal: Rig
    record: Checked | None
    settings: DiagnosisSettings

    @cached_property
    def _case(self) -> Case | None:
        if self.record is None:
            return None
        case = case_from(self.record.record, self.nominal, self.record.masked)
        return spread_over(case.with_noise(fitted_noise(self.cases)), self.nominal, self.settings)

    def score(
        self, problem: Problem, theta: FloatArray, outputs: list[dict[str, FloatArray]] | None = None
    ) -> Score:
        """Return the score of a model. outputs: its channels on the cases, where simulated already."""
        rule = self.settings.blocks
        if self.record is None or (case := self._case) is None:
            everything = replace(problem, cases=self.cases)
            return score_on(everything, self.cases, TEST, outputs or everything.outputs(theta), rule)
        rig, offsets = apply(problem.rig, problem.unknowns, theta)
        phased = in_phase(rig.under(case.source), self.record.record)
        (outputs,) = simulate_cases((case,), phased, offsets, on_angle=problem.on_angle)
        return score(problem, (case,), outputs, rule)

    def score_of(self, model: Candidate) -> Score:
        """Return the score of a model that is fitted and simulated on the cases."""
        return self.score(model.problem, model.solution.theta, model.outputs)


def fitted_noise(cases: Sequence[Case]) -> dict[str, float]:
    """Return the noise of each channel that some case has, of the first case with it."""
    return {n: noise for case in reversed(cases) for n, noise in case.noise.items()}


def held_out_data(selection: Selection, record: Checked | None) -> HeldOut:
    """Return the data that test the models of a selection. record: replaces the test blocks."""
    return HeldOut(selection.cases, selection.models[0].problem.rig, record, selection.last.settings)


def evaluate(
    selection: Selection, chosen: Candidate, held_out: HeldOut, pools: Pools, settings: DiagnosisSettings
) -> Evaluated:
    """Re-fit a model to the training and validation blocks, and score it on the held-out data."""
    cases, blocks = selection.cases, (*TRAIN, *VALIDATION)
    setup = FitSetup(cases, settings, pools.run, chosen.validation, blocks=blocks, gain=LAST_GAIN)
    model = fit_candidate(setup, chosen.problem, chosen.solution.theta)
    train = score_on(model.problem, cases, blocks, model.outputs, settings.blocks)
    test = held_out.score_of(model)
    return Evaluated(model.solution, model.outputs, train, test)
