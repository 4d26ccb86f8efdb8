"""The conclusion: the verdict, the causes and what was rejected, what is left, and what to run next."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence

from rsea_ros.checks.faults import Checked
from rsea_ros.diagnosis.coherence import lost_above
from rsea_ros.diagnosis.criteria import is_at_floor, takes_most, verdict_of
from rsea_ros.diagnosis.evaluation import Evaluated
from rsea_ros.diagnosis.naming.causes import alternative_of, cause_of, dropped_of, latest, rejected_of
from rsea_ros.diagnosis.naming.status import Named, named
from rsea_ros.diagnosis.naming.weighing import Weighing
from rsea_ros.diagnosis.next_experiment import amplitude_series, separating
from rsea_ros.diagnosis.residual_analysis import misfits, spectrum
from rsea_ros.diagnosis.result import (
    Diagnosis,
    Experiment,
    Verdict,
)
from rsea_ros.diagnosis.score import Score
from rsea_ros.diagnosis.selection import Selection
from rsea_ros.diagnosis.sentences import (
    also_in_model,
    coherence_lost,
    coloured_noise,
    on_measured_angle,
    verdict_sentence,
)
from rsea_ros.diagnosis.settings import DEFAULT, DiagnosisSettings
from rsea_ros.errors import IdentificationError
from rsea_ros.identification.confidence import what_is_not_told
from rsea_ros.identification.identify import fit_percent, identified_rig, overlays_of, parameters_of
from rsea_ros.identification.problem import Case
from rsea_ros.identification.workers import Pools
from rsea_ros.model.rig import Rig
from rsea_ros.signals import Record

PRIMARY = ("ft", "deflection", "position", "velocity", "motor_torque")
"""The channel that gains and verdicts speak of: the first of these that is measured."""


def diagnosis_of(
    weighing: Weighing,
    checked: Sequence[Checked],
    records: Sequence[Record],
    rig: Rig,
    pools: Pools,
    settings: DiagnosisSettings,
) -> Diagnosis:
    """Return what weighed causes come to. checked: of the records and the held-out one."""
    selection, stages = weighing.selection, weighing.stages
    channel = next((n for n in PRIMARY if n in stages[0].test.sums), None)
    if channel is None:
        raise IdentificationError(
            f"{records[0].source}: no sample is left to test on, expected a longer record"
        )
    faults = tuple(f for c in checked for f in c.faults)
    levels, said = settings.floor, naming_of(weighing, settings)
    steps = itertools.pairwise(stages)
    dropped = [dropped_of(a, b, said, channel) for a, b in steps if not is_named(b, said)]
    stages = without_unnamed_end(stages, said)
    statuses = [said[s.added].status if s.added in said else None for s in stages[1:]]
    verdict = verdict_of([s.test for s in stages], statuses, levels, faults)
    if verdict == "unexplained":
        channel, stages = main_channel(stages[0].test, channel, levels.reached), stages[:1]
    first, last = stages[0], stages[-1]
    causes = tuple(
        cause_of(selection, a, b, last, channel, said[b.added])
        for a, b in itertools.pairwise(stages)
        if is_named(b, said)
    )
    main = causes[0].channel if causes else channel
    decided = {c.name for c in causes} | {r.name for r in dropped}
    others = [t for t in latest(selection.trials) if t.name not in decided]
    against = [(c.name, w, p) for c in causes for w, p in said[c.name].rivals]
    alternatives = tuple(pools.fits.map(lambda item: alternative_of(*item), against))
    rejected = pools.fits.map(lambda t: rejected_of(t, selection.cases, main), others)
    case = selection.cases[0]
    where = misfits(case, first.outputs[0], main, rig)
    baseline = parameters_of(first.solution, first.confidence)
    return Diagnosis(
        verdict=verdict,
        channel=main,
        sentence=verdict_sentence(
            verdict, causes, main, first.test.ratio(main), last.test.ratio(main), faults,
            at_floor=is_at_floor(last.test, levels),
        ),
        rig_name=rig.name,
        sources=tuple(r.source for r in records),
        duration=sum(r.stop - r.start for r in records),
        rate=records[0]["command"].rate,
        faults=faults,
        baseline_rig=identified_rig(first.solution, baseline),
        baseline=baseline,
        extended_rig=identified_rig(last.solution, parameters_of(last.solution, last.confidence)),
        noise_rms=dict(case.noise),
        residual_rms=_rms(first.test, case),
        fit_percent=_fit(first, selection.cases),
        extended_residual_rms=_rms(last.test, case),
        extended_fit_percent=_fit(last, selection.cases),
        at_noise_floor=is_at_floor(last.test, levels),
        misfit=where,
        causes=causes,
        alternatives=alternatives,
        rejected=(*dropped, *rejected),
        next_experiment=_next_experiment(selection, stages, verdict, records[0]),
        remaining=misfits(case, last.outputs[0], main, rig),
        masked=checked[0].masked,
        settings=settings,
        before=overlays_of(case, first.outputs[0]),
        after=overlays_of(case, last.outputs[0]),
        spectra=tuple(spectrum(case, first.outputs[0], last.outputs[0], n) for n in first.test.sums),
        statements=(
            *also_in_model([n for n in last.solution.problem.added if n not in {c.name for c in causes}]),
            *what_is_not_told(first.solution.problem.unknowns, first.confidence),
            *coherence_lost(lost_above(case, main), main),
            *on_measured_angle(last.solution.problem),
            *coloured_noise(sorted(case.coloured)),
        ),
    )


def naming_of(weighing: Weighing, settings: DiagnosisSettings) -> dict[str, Named]:
    """Return by cause what may be said of it."""
    first, last = weighing.stages[0].test, weighing.stages[-1].test
    at_floor, most = is_at_floor(last, settings.floor), takes_most(first, last, settings)
    return {n.cause.evidence.name: n for n in named(weighing.places, at_floor, most, settings)}


def is_named(stage: Evaluated, said: Mapping[str, Named]) -> bool:
    """Tell whether the cause that a stage adds may be named."""
    return stage.added in said and said[stage.added].status is not None


def without_unnamed_end(stages: Sequence[Evaluated], said: Mapping[str, Named]) -> list[Evaluated]:
    """Return the stages without the last ones whose cause is not named: no other was fitted beside it."""
    kept = list(stages)
    while len(kept) > 1 and not is_named(kept[-1], said):
        kept.pop()
    return kept


def main_channel(test: Score, channel: str, reached: float = DEFAULT.floor.reached) -> str:
    """Return the channel that shows an unexplained residual: `channel` if above noise, else the worst."""
    return channel if test.ratio(channel) > reached else test.worst


def _next_experiment(
    selection: Selection, stages: Sequence[Evaluated], verdict: Verdict, record: Record
) -> Experiment | None:
    """Return the run that would tell what these data cannot; None when nothing is left to tell."""
    for stage in stages[1:]:
        rivals = selection.rivals_of(stage.added)
        if rivals:
            return separating(stage.solution, [m.solution for m in rivals], record["command"].rate)
    if verdict in ("unexplained", "partly_explained") and not is_at_floor(stages[-1].test):
        last = stages[-1]
        return amplitude_series(last.solution, last.test.ratio(last.test.worst), record["command"].rate)
    return None


def _rms(test: Score, case: Case) -> dict[str, float]:
    return {n: test.ratio(n) * case.noise[n] for n in test.sums}


def _fit(stage: Evaluated, cases: tuple[Case, ...]) -> dict[str, float]:
    """Return the fit of every channel on all samples that count, %."""
    case, out = cases[0], stage.outputs[0]
    keep = {n: case.mask[n] for n in stage.test.sums if n in case.measured}
    return {n: fit_percent((out[n] - case.measured[n])[k], case.measured[n][k]) for n, k in keep.items()}
