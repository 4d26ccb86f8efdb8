"""The conclusion: the selected causes weighed and named, the verdict, what was rejected, what to run next.

The door of this folder.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from rsea_ros.checks.faults import Checked
from rsea_ros.diagnosis.coherence import lost_above
from rsea_ros.diagnosis.criteria import is_at_floor, takes_most, verdict_of
from rsea_ros.diagnosis.evaluation import Evaluated
from rsea_ros.diagnosis.naming.causes import (
    alternative_of,
    cause_of,
    dropped_of,
    latest,
    rejected_of,
    undetermined_play,
)
from rsea_ros.diagnosis.naming.status import Named, named
from rsea_ros.diagnosis.naming.weighing import Weighing, weigh
from rsea_ros.diagnosis.next_experiment import amplitude_series, separating
from rsea_ros.diagnosis.residual_analysis import misfits, spectrum
from rsea_ros.diagnosis.result import Cause, Diagnosis, Experiment, Rejected, Verdict
from rsea_ros.diagnosis.score import Score
from rsea_ros.diagnosis.selection import Selection
from rsea_ros.diagnosis.settings import DEFAULT, DiagnosisSettings
from rsea_ros.errors import IdentificationError
from rsea_ros.identification.confidence import undetermined
from rsea_ros.identification.estimates import identified_rig, overlays_of, parameters_of
from rsea_ros.identification.problem import Case
from rsea_ros.identification.remark import Remark
from rsea_ros.identification.workers import Pools
from rsea_ros.model.prediction import fit_percent
from rsea_ros.model.rig import Rig
from rsea_ros.signals import MEASURED, Fault, Record


@dataclass(frozen=True)
class Examined:
    """What a diagnosis is of: the records as read and as checked, the held-out one as checked, the rig."""

    records: Sequence[Record]
    checked: Sequence[Checked]
    holdout: Checked | None
    rig: Rig

    @property
    def faults(self) -> tuple[Fault, ...]:
        """The faults of all records, the held-out one last."""
        every = [*self.checked, *([self.holdout] if self.holdout is not None else [])]
        return tuple(fault for checked in every for fault in checked.faults)


@dataclass(frozen=True)
class Outcome:
    """What the weighed causes come to.

    channel: of which verdict and gains speak. stages: models from the nominal one to the extended one.
    dropped: what was accepted and may not be named. named: by cause what may be said of it.
    """

    verdict: Verdict
    channel: str
    stages: Sequence[Evaluated]
    causes: tuple[Cause, ...]
    dropped: tuple[Rejected, ...]
    named: Mapping[str, Named]


def conclude(
    selection: Selection,
    stages: Sequence[Evaluated],
    examined: Examined,
    pools: Pools,
    settings: DiagnosisSettings,
) -> Diagnosis:
    """Weigh and name the causes of a selection. stages: its models, evaluated."""
    weighing = weigh(selection, stages, examined.holdout, pools, settings)
    outcome = outcome_of(weighing, examined, settings)
    return _diagnosis(weighing.selection, outcome, examined, pools, settings)


def outcome_of(weighing: Weighing, examined: Examined, settings: DiagnosisSettings) -> Outcome:
    """Return the verdict on weighed causes, those that are named, and those that may not be."""
    stages, levels = weighing.stages, settings.floor
    channel = next((n for n in MEASURED if n in stages[0].test.sums), None)
    if channel is None:
        source = examined.records[0].source
        raise IdentificationError(f"{source}: no sample is left to test on, expected a longer record")
    naming = naming_of(weighing, settings)
    steps = itertools.pairwise(stages)
    dropped = tuple(dropped_of(a, b, naming, channel) for a, b in steps if not is_named(b, naming))
    stages = without_unnamed_end(stages, naming)
    statuses = [naming[s.added].status if s.added in naming else None for s in stages[1:]]
    verdict = verdict_of([s.test for s in stages], statuses, levels, examined.faults)
    if verdict == "unexplained":
        channel, stages = main_channel(stages[0].test, channel, levels.reached), stages[:1]
    causes = tuple(
        cause_of(weighing.selection, a, b, stages[-1], channel, naming[b.added])
        for a, b in itertools.pairwise(stages)
        if is_named(b, naming)
    )
    return Outcome(verdict, causes[0].channel if causes else channel, stages, causes, dropped, naming)


def naming_of(weighing: Weighing, settings: DiagnosisSettings) -> dict[str, Named]:
    """Return by cause what may be said of it."""
    first, last = weighing.stages[0].test, weighing.stages[-1].test
    at_floor, most = is_at_floor(last, settings.floor), takes_most(first, last, settings)
    return {n.cause.evidence.name: n for n in named(weighing.places, at_floor, most, settings)}


def is_named(stage: Evaluated, naming: Mapping[str, Named]) -> bool:
    """Return whether the cause that a stage adds may be named."""
    return stage.added in naming and naming[stage.added].status is not None


def without_unnamed_end(stages: Sequence[Evaluated], naming: Mapping[str, Named]) -> list[Evaluated]:
    """Return the stages without the last ones whose cause is not named: no other was fitted beside it."""
    kept = list(stages)
    while len(kept) > 1 and not is_named(kept[-1], naming):
        kept.pop()
    return kept


def main_channel(test: Score, channel: str, reached: float = DEFAULT.floor.reached) -> str:
    """Return the channel that shows an unexplained residual: `channel` if above noise, else the worst."""
    return channel if test.ratio(channel) > reached else test.worst


def _diagnosis(
    selection: Selection, outcome: Outcome, examined: Examined, pools: Pools, settings: DiagnosisSettings
) -> Diagnosis:
    """Return the diagnosis of an outcome, with the rivals, what was rejected, and the curves of a report."""
    first, last, main = outcome.stages[0], outcome.stages[-1], outcome.channel
    case, records, rig = selection.cases[0], examined.records, examined.rig
    rivals = [(c.name, w, p) for c in outcome.causes for w, p in outcome.named[c.name].rivals]
    rejected = _rejected(selection, outcome, pools)
    baseline = parameters_of(first.solution, first.confidence)
    return Diagnosis(
        verdict=outcome.verdict,
        channel=main,
        rig_name=rig.name,
        sources=tuple(r.source for r in records),
        duration=sum(r.stop - r.start for r in records),
        rate=records[0]["command"].rate,
        faults=examined.faults,
        baseline_rig=identified_rig(first.solution, baseline),
        baseline=baseline,
        extended_rig=identified_rig(last.solution, parameters_of(last.solution, last.confidence)),
        noise_rms=dict(case.noise),
        residual_rms=_rms(first.test, case),
        fit_percent=_fit(first, selection.cases),
        extended_residual_rms=_rms(last.test, case),
        extended_fit_percent=_fit(last, selection.cases),
        at_noise_floor=is_at_floor(last.test, settings.floor),
        misfit=misfits(case, first.outputs[0], main, rig),
        causes=outcome.causes,
        alternatives=tuple(pools.fits.map(lambda rival: alternative_of(*rival), rivals)),
        rejected=rejected,
        next_experiment=_next_experiment(selection, outcome, records[0]),
        remaining=misfits(case, last.outputs[0], main, rig),
        masked=examined.checked[0].masked,
        settings=settings,
        before=overlays_of(case, first.outputs[0]),
        after=overlays_of(case, last.outputs[0]),
        spectra=tuple(spectrum(case, first.outputs[0], last.outputs[0], n) for n in first.test.sums),
        remarks=(*undetermined_play(selection, outcome.causes, rejected), *_remarks(outcome, case)),
    )


def _rejected(selection: Selection, outcome: Outcome, pools: Pools) -> tuple[Rejected, ...]:
    """Return what was accepted and may not be named, then all others that were tried."""
    decided = {c.name for c in outcome.causes} | {r.name for r in outcome.dropped}
    others = [t for t in latest(selection.trials) if t.name not in decided]
    rejected = pools.fits.map(lambda t: rejected_of(t, selection.cases, outcome.channel), others)
    return (*outcome.dropped, *rejected)


def _remarks(outcome: Outcome, case: Case) -> list[Remark]:
    """Return what the data cannot determine and what a reader must know of the extended model."""
    first, last = outcome.stages[0].solution.problem, outcome.stages[-1].solution.problem
    named = {c.name for c in outcome.causes}
    unnamed = tuple(n for n in last.added if n not in named)
    lost, channel = lost_above(case, outcome.channel), outcome.channel
    return [
        *([Remark("also_in_model", unnamed)] if unnamed else []),
        *undetermined(first.unknowns, outcome.stages[0].confidence),
        *([Remark("coherence_lost", (channel,), (lost,), "Hz")] if lost is not None else []),
        *([Remark("on_measured_angle")] if last.ride else []),
        *([Remark("coloured_noise", tuple(sorted(case.coloured)))] if case.coloured else []),
    ]


def _next_experiment(selection: Selection, outcome: Outcome, record: Record) -> Experiment | None:
    """Return the run that would decide what these data cannot; None if nothing is open."""
    rate, last = record["command"].rate, outcome.stages[-1]
    for stage in outcome.stages[1:]:
        rivals = selection.rivals_of(stage.added)
        if rivals:
            return separating(stage.solution, [m.solution for m in rivals], rate)
    if outcome.verdict in ("unexplained", "partly_explained") and not is_at_floor(last.test):
        return amplitude_series(last.solution, last.test.ratio(last.test.worst), rate)
    return None


def _rms(test: Score, case: Case) -> dict[str, float]:
    return {n: test.ratio(n) * case.noise[n] for n in test.sums}


def _fit(stage: Evaluated, cases: tuple[Case, ...]) -> dict[str, float]:
    """Return the fit of every channel on all samples that count, %."""
    case, out = cases[0], stage.outputs[0]
    keep = {n: case.mask[n] for n in stage.test.sums if n in case.measured}
    return {n: fit_percent((out[n] - case.measured[n])[k], case.measured[n][k]) for n, k in keep.items()}
