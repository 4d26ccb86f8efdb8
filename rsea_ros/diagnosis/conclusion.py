"""The conclusion: verdict, causes with sizes and gains, what was rejected, what is left, what to run next."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from rsea_ros.diagnosis.coherence import lost_above
from rsea_ros.diagnosis.data_split import JUDGE, Score, score_on
from rsea_ros.diagnosis.evaluation import Examined, Stage, effect_added
from rsea_ros.diagnosis.judge import gain
from rsea_ros.diagnosis.naming import Named, named
from rsea_ros.diagnosis.next_experiment import amplitude_series, separating
from rsea_ros.diagnosis.residual_analysis import misfits, spectrum
from rsea_ros.diagnosis.result import (
    Alternative,
    Cause,
    Diagnosis,
    Estimate,
    Experiment,
    Rejected,
    Status,
    Verdict,
)
from rsea_ros.diagnosis.sentences import (
    also_in_model,
    coherence_lost,
    coloured_noise,
    evidence_of,
    improbable,
    on_measured_angle,
    verdict_sentence,
)
from rsea_ros.diagnosis.stepwise import Search
from rsea_ros.diagnosis.trial import Trial
from rsea_ros.diagnosis.verdict import FLOOR, reached, takes_most, verdict_of
from rsea_ros.diagnosis.weighing import Place, Weighed
from rsea_ros.diagnosis.workers import Workers
from rsea_ros.effects.catalogue import effect_named
from rsea_ros.errors import IdentificationError
from rsea_ros.identification.confidence import confidence_of, what_is_not_told
from rsea_ros.identification.identify import fit_percent, identified_rig, overlays_of, parameters_of
from rsea_ros.identification.problem import Case
from rsea_ros.identification.result import ParameterEstimate
from rsea_ros.identification.solver import solve
from rsea_ros.identification.unknowns import CLOCK_DOUBT
from rsea_ros.signals import Record

MODEL_DOUBT = 0.0025
"""Relative, one sigma: measured between the simulation and the second bench in test/independent."""
PRIMARY = ("ft", "position", "velocity", "motor_torque")
"""The channel that gains and verdicts speak of: the first of these that is there."""


def conclusion(examined: Examined, places: Sequence[Place], at_work: Workers) -> Diagnosis:
    """Return what a search and its judged stages come to. places: the evidence for each cause."""
    found, stages, records, rig = examined.found, examined.stages, examined.records, examined.rig
    checked = [*examined.checked, *([examined.judging] if examined.judging else [])]
    channel = next((n for n in PRIMARY if n in stages[0].judged.sums), None)
    if channel is None:
        raise IdentificationError(
            f"{records[0].source}: no sample is left to judge by, expected a longer record"
        )
    first, last = stages[0].judged, stages[-1].judged
    said = {n.cause.evidence.name: n for n in named(places, reached(last), takes_most(first, last))}
    stages = without_unnamed_end(stages, said)
    verdict = verdict_of(stages, [_status(said, stage) for stage in stages[1:]])
    if verdict == "unexplained":
        stages, channel = stages[:1], spoken_of(stages[0].judged, channel)
    without, all_causes = stages[0], stages[-1]
    added = [
        (_cause(found, a, b, all_causes, channel), said.get(effect_added(b)))
        for a, b in itertools.pairwise(stages)
    ]
    causes = tuple(replace(c, status=n.status, probability=n.probability) for c, n in added if n and n.status)
    against = [(c.name, w, p) for c, n in added if n and n.status for w, p in n.rivals]
    alternatives = tuple(at_work.fits.map(lambda item: alternative(*item), against))
    listed = {c.name for c in causes}
    others = [t for t in _latest(found.trials) if t.name not in listed]
    rejected = at_work.fits.map(lambda t: _rejected(t, found.cases, channel, said), others)
    case = found.cases[0]
    faults = tuple(f for c in checked for f in c.faults)
    where = misfits(case, without.outputs[0], channel, rig)
    baseline = parameters_of(without.solution, without.confidence)
    return Diagnosis(
        verdict=verdict,
        sentence=verdict_sentence(
            verdict,
            causes,
            channel,
            without.judged.ratio(channel),
            all_causes.judged.ratio(channel),
            faults,
            reached(all_causes.judged),
        ),
        rig_name=rig.name,
        sources=tuple(r.source for r in records),
        duration=sum(r.stop - r.start for r in records),
        rate=records[0]["command"].rate,
        faults=faults,
        baseline_rig=identified_rig(without.solution, baseline),
        baseline=baseline,
        extended_rig=identified_rig(
            all_causes.solution, parameters_of(all_causes.solution, all_causes.confidence)
        ),
        noise_rms=dict(case.noise),
        residual_rms=_rms(without.judged, case),
        fit_percent=_fit(without, found.cases),
        extended_residual_rms=_rms(all_causes.judged, case),
        extended_fit_percent=_fit(all_causes, found.cases),
        at_noise_floor=reached(all_causes.judged),
        misfit=where,
        causes=causes,
        alternatives=alternatives,
        rejected=tuple(rejected),
        next_experiment=_next_experiment(found, stages, verdict, records[0]),
        remaining=misfits(case, all_causes.outputs[0], channel, rig),
        masked=checked[0].masked,
        before=overlays_of(case, without.outputs[0]),
        after=overlays_of(case, all_causes.outputs[0]),
        spectra=tuple(
            spectrum(case, without.outputs[0], all_causes.outputs[0], n) for n in without.judged.sums
        ),
        statements=(
            *also_in_model([c.name for c, n in added if not n or not n.status]),
            *what_is_not_told(without.solution.problem.unknowns, without.confidence),
            *coherence_lost(lost_above(case, channel), channel),
            *on_measured_angle(all_causes.solution.problem),
            *coloured_noise(sorted(case.coloured)),
        ),
    )


def spoken_of(judged: Score, channel: str) -> str:
    """Return the channel that tells an unexplained residual: the worst, unless `channel` is above noise."""
    return channel if judged.ratio(channel) > FLOOR else judged.worst


def without_unnamed_end(stages: Sequence[Stage], said: Mapping[str, Named]) -> list[Stage]:
    """Return the stages without the last ones whose cause is not to be named: the others need them not."""
    kept = list(stages)
    while len(kept) > 1 and _status(said, kept[-1]) is None:
        kept.pop()
    return kept


def _status(said: Mapping[str, Named], stage: Stage) -> Status | None:
    n = said.get(effect_added(stage))
    return n.status if n else None


def _cause(found: Search, without: Stage, with_it: Stage, last: Stage, channel: str) -> Cause:
    """Return an accepted cause: its parameters beside all causes, its own gain on data that took no part."""
    effect = effect_named(effect_added(with_it))
    speaks = (
        channel
        if without.judged.ratio(channel) > 1.02 * with_it.judged.ratio(channel)
        else max(
            without.judged.sums, key=lambda n: without.judged.ratio(n) / max(with_it.judged.ratio(n), 1e-12)
        )
    )
    held_out, interval = gain(with_it.judged, without.judged, speaks)
    train, _ = gain(with_it.train, without.train, speaks)
    return Cause(
        name=effect.name,
        parameters=sizes(effect.name, parameters_of(last.solution, last.confidence)),
        gain_train=train,
        gain_holdout=held_out,
        gain_holdout_ci95=interval,
        evidence=evidence_of(
            effect, speaks, without.judged.ratio(speaks), with_it.judged.ratio(speaks), held_out
        ),
        equation=effect.equation,
        channel=speaks,
        confusable_with=tuple(m.causes[-1] for m in found.rivals_of(effect.name)),
    )


def alternative(instead_of: str, weighed: Weighed, probability: float) -> Alternative:
    """Return a rival of a cause with its size where it acts in that cause's place."""
    claim = weighed.claim
    solution = solve(claim.problem, claim.theta, iterations=0)
    estimates = parameters_of(solution, confidence_of(solution))
    evidence = weighed.evidence
    held_out, interval = gain(claim.with_it, claim.without, evidence.channel)
    return Alternative(
        name=claim.name,
        instead_of=instead_of,
        parameters=sizes(claim.name, estimates),
        gain_holdout=held_out,
        gain_holdout_ci95=interval,
        channel=evidence.channel,
        probability=probability,
    )


def sizes(effect: str, estimates: Sequence[ParameterEstimate]) -> dict[str, Estimate]:
    """Return the parameters of an effect among estimates, by their names without the effect's."""
    own = [p for p in estimates if p.name.startswith(effect + ".")]
    return {p.name.split(".")[1]: honest(p) for p in own}


def honest(estimate: ParameterEstimate) -> Estimate:
    """Return an estimate whose interval also holds what no residual shows.

    The fit's interval speaks of noise alone. Two right simulations of one bench differ by about MODEL_DOUBT
    in what they make of a parameter (their steps, how they smooth a law), and no time is known better than
    the sensors' clocks.
    """
    doubt = MODEL_DOUBT * abs(estimate.value)
    if estimate.unit == "s":
        doubt = float(np.hypot(doubt, CLOCK_DOUBT))
    low, high = (float(np.hypot(end - estimate.value, 1.96 * doubt)) for end in estimate.ci95)
    return Estimate(estimate.value, estimate.unit, (estimate.value - low, estimate.value + high))


def _next_experiment(
    found: Search, stages: Sequence[Stage], verdict: Verdict, record: Record
) -> Experiment | None:
    """Return the run that would tell what these data cannot; None when nothing is left to tell."""
    for stage in stages[1:]:
        rivals = found.rivals_of(effect_added(stage))
        if rivals:
            return separating(stage.solution, [m.solution for m in rivals], record["command"].rate)
    if verdict in ("unexplained", "partly_explained"):
        return amplitude_series(float(np.nanmax(np.abs(record["command"].y))))
    return None


def _latest(trials: Sequence[Trial]) -> list[Trial]:
    """Return each effect's trial that says most: one fitted to everything, else the last."""
    best: dict[str, Trial] = {}
    for t in trials:
        if t.name not in best or t.is_full or not best[t.name].is_full:
            best[t.name] = t
    return list(best.values())


def _rejected(trial: Trial, cases: tuple[Case, ...], channel: str, said: Mapping[str, Named]) -> Rejected:
    """Return a trial with its gain, on data that judge, over the model that it was tried beside."""
    problem = replace(trial.problem, cases=cases)
    with_it = score_on(problem, cases, JUDGE, problem.outputs(trial.theta))
    without = score_on(problem, cases, JUDGE, trial.beside.outputs)
    weighed = said.get(trial.name)
    why = trial.why if weighed is None else improbable(weighed.cause.evidence, weighed.probability)
    return Rejected(trial.name, gain(with_it, without, channel)[0], why)


def _rms(judged: Score, case: Case) -> dict[str, float]:
    return {n: judged.ratio(n) * case.noise[n] for n in judged.sums}


def _fit(stage: Stage, cases: tuple[Case, ...]) -> dict[str, float]:
    """Return the fit of every channel on all samples that count, %."""
    case, out = cases[0], stage.outputs[0]
    keep = {n: case.mask[n] for n in stage.judged.sums if n in case.measured}
    return {n: fit_percent((out[n] - case.measured[n])[k], case.measured[n][k]) for n, k in keep.items()}
