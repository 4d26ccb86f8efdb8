"""The conclusion: verdict, causes with sizes and gains, what was rejected, what is left, what to run next."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from rsea_ros.checks.faults import Checked
from rsea_ros.diagnosis.coherence import lost_above
from rsea_ros.diagnosis.data_split import TEST
from rsea_ros.diagnosis.evaluation import Evaluated
from rsea_ros.diagnosis.naming import Named, named
from rsea_ros.diagnosis.next_experiment import amplitude_series, separating
from rsea_ros.diagnosis.residual_analysis import misfits, spectrum
from rsea_ros.diagnosis.result import (
    Alternative,
    Cause,
    Diagnosis,
    Estimate,
    Experiment,
    Reason,
    Rejected,
    Verdict,
)
from rsea_ros.diagnosis.score import Score, gain, score_on
from rsea_ros.diagnosis.selection import Selection, Trial
from rsea_ros.diagnosis.sentences import (
    also_in_model,
    coherence_lost,
    coloured_noise,
    evidence_of,
    on_measured_angle,
    verdict_sentence,
)
from rsea_ros.diagnosis.settings import DEFAULT, DiagnosisSettings
from rsea_ros.diagnosis.verdict import is_at_floor, takes_most, verdict_of
from rsea_ros.diagnosis.weighing import Weighed, Weighing
from rsea_ros.effects.catalogue import effect_named
from rsea_ros.errors import IdentificationError
from rsea_ros.identification.confidence import confidence_of, what_is_not_told
from rsea_ros.identification.identify import fit_percent, identified_rig, overlays_of, parameters_of
from rsea_ros.identification.problem import Case
from rsea_ros.identification.result import ParameterEstimate
from rsea_ros.identification.solver import solve
from rsea_ros.identification.workers import Pools
from rsea_ros.model.rig import CLOCK_DOUBT, Rig
from rsea_ros.signals import Record

MODEL_DOUBT = 0.0025
"""Relative, one sigma: measured between the simulation and the second bench in test/independent."""
PRIMARY = ("ft", "deflection", "position", "velocity", "motor_torque")
"""The channel that gains and verdicts speak of: the first of these that is there."""


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
            f"{records[0].source}: no sample is left to judge by, expected a longer record"
        )
    faults = tuple(f for c in checked for f in c.faults)
    levels, said = settings.floor, naming_of(weighing, settings)
    dropped = [_dropped(a, b, said, channel) for a, b in itertools.pairwise(stages) if not is_named(b, said)]
    stages = without_unnamed_end(stages, said)
    statuses = [said[s.added].status if s.added in said else None for s in stages[1:]]
    verdict = verdict_of([s.test for s in stages], statuses, levels, faults)
    if verdict == "unexplained":
        channel, stages = main_channel(stages[0].test, channel, levels.reached), stages[:1]
    first, last = stages[0], stages[-1]
    causes = tuple(
        _cause(selection, a, b, last, channel, said[b.added])
        for a, b in itertools.pairwise(stages)
        if is_named(b, said)
    )
    main = causes[0].channel if causes else channel
    decided = {c.name for c in causes} | {r.name for r in dropped}
    others = [t for t in _latest(selection.trials) if t.name not in decided]
    against = [(c.name, w, p) for c in causes for w, p in said[c.name].rivals]
    alternatives = tuple(pools.fits.map(lambda item: alternative(*item), against))
    rejected = pools.fits.map(lambda t: _rejected(t, selection.cases, main), others)
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


def _cause(
    selection: Selection,
    without: Evaluated,
    with_it: Evaluated,
    last: Evaluated,
    channel: str,
    said: Named,
) -> Cause:
    """Return an accepted cause: its parameters beside all causes, its own gain on data that took no part."""
    effect = effect_named(with_it.added)
    speaks = (
        channel
        if without.test.ratio(channel) > 1.02 * with_it.test.ratio(channel)
        else max(without.test.sums, key=lambda n: without.test.ratio(n) / max(with_it.test.ratio(n), 1e-12))
    )
    held_out, interval = gain(with_it.test, without.test, speaks)
    train, _ = gain(with_it.train, without.train, speaks)
    return Cause(
        name=effect.name,
        parameters=sizes(effect.name, parameters_of(last.solution, last.confidence)),
        gain_train=train,
        gain_holdout=held_out,
        gain_holdout_ci95=interval,
        evidence=evidence_of(
            effect, speaks, without.test.ratio(speaks), with_it.test.ratio(speaks), held_out
        ),
        equation=effect.equation,
        channel=speaks,
        confusable_with=tuple(m.newest for m in selection.rivals_of(effect.name)),
        status=said.status or "leading",
        probability=said.probability,
    )


def alternative(instead_of: str, weighed: Weighed, probability: float) -> Alternative:
    """Return a rival of a cause with its size where it acts in that cause's place."""
    claim, evidence = weighed.claim, weighed.evidence
    solution = solve(claim.problem, claim.theta, iterations=0)
    held_out, interval = gain(claim.with_it, claim.without, evidence.channel)
    return Alternative(
        name=claim.name,
        instead_of=instead_of,
        parameters=sizes(claim.name, parameters_of(solution, confidence_of(solution))),
        gain_holdout=held_out,
        gain_holdout_ci95=interval,
        channel=evidence.channel,
        probability=probability,
    )


def sizes(effect: str, estimates: Sequence[ParameterEstimate]) -> dict[str, Estimate]:
    """Return the parameters of an effect among estimates, by their names without the effect's."""
    own = [p for p in estimates if p.name.startswith(effect + ".")]
    return {p.name.split(".")[1]: with_model_uncertainty(p) for p in own}


def with_model_uncertainty(estimate: ParameterEstimate) -> Estimate:
    """Return an estimate whose interval also holds what no residual shows.

    The fit's interval speaks of noise alone. Two right simulations of one bench differ by about MODEL_DOUBT
    in what they make of a parameter (their steps, how they smooth a law), and no time is known better than
    the sensors' clocks. The interval of the noise alone stands beside the whole one.
    """
    value, sd = estimate.value, MODEL_DOUBT * abs(estimate.value)
    if estimate.unit == "s":
        sd = float(np.hypot(sd, CLOCK_DOUBT))
    low, high = (float(np.hypot(end - value, 1.96 * sd)) for end in estimate.ci95)
    return Estimate(value, estimate.unit, (value - low, value + high), estimate.ci95, sd)


def _next_experiment(
    selection: Selection, stages: Sequence[Evaluated], verdict: Verdict, record: Record
) -> Experiment | None:
    """Return the run that would tell what these data cannot; None when nothing is left to tell."""
    for stage in stages[1:]:
        rivals = selection.rivals_of(stage.added)
        if rivals:
            return separating(stage.solution, [m.solution for m in rivals], record["command"].rate)
    if verdict in ("unexplained", "partly_explained") and not is_at_floor(stages[-1].test):
        return amplitude_series(float(np.nanmax(np.abs(record["command"].y))), stages[0].solution.problem.rig)
    return None


def _latest(trials: Sequence[Trial]) -> list[Trial]:
    """Return each effect's trial that says most: one fitted to everything, else the last."""
    best: dict[str, Trial] = {}
    for t in trials:
        if t.name not in best or t.is_full or not best[t.name].is_full:
            best[t.name] = t
    return list(best.values())


def _rejected(trial: Trial, cases: tuple[Case, ...], channel: str) -> Rejected:
    """Return a trial with its gain, on data that judge, over the model that it was tried beside."""
    problem = replace(trial.problem, cases=cases)
    with_it = score_on(problem, cases, TEST, problem.outputs(trial.theta))
    without = score_on(problem, cases, TEST, trial.beside.outputs)
    size = gain(with_it, without, channel)[0]
    return Rejected(trial.name, size, trial.reason, trial.rival, trial.is_full)


def _dropped(
    without: Evaluated, with_it: Evaluated, said: Mapping[str, Named], channel: str
) -> Rejected:
    """Return an effect that was accepted and may not be named, with the gain of what it helps most."""
    weighed = said.get(with_it.added)
    if weighed is None:
        return Rejected(with_it.added, gain(with_it.test, without.test, channel)[0], "leaves_too_much")
    evidence = weighed.cause.evidence
    reason: Reason = "improbable" if evidence.is_sure else "leaves_too_much"
    return Rejected(with_it.added, evidence.gain, reason, probability=weighed.probability)


def _rms(test: Score, case: Case) -> dict[str, float]:
    return {n: test.ratio(n) * case.noise[n] for n in test.sums}


def _fit(stage: Evaluated, cases: tuple[Case, ...]) -> dict[str, float]:
    """Return the fit of every channel on all samples that count, %."""
    case, out = cases[0], stage.outputs[0]
    keep = {n: case.mask[n] for n in stage.test.sums if n in case.measured}
    return {n: fit_percent((out[n] - case.measured[n])[k], case.measured[n][k]) for n, k in keep.items()}
