"""The conclusion of a diagnosis: names with their sizes and gains, verdict, and what remains.
"""

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rsea_ros.diagnosis import result as results
from rsea_ros.diagnosis.candidate import main_of
from rsea_ros.diagnosis.criteria import is_at_floor, verdict_of
from rsea_ros.diagnosis.evaluation import Evaluated, Examined, HeldOut, Selection, Trial, held_out_data
from rsea_ros.diagnosis.naming.status import Named, name_causes
from rsea_ros.diagnosis.naming.weighing import Weighed, weigh
from rsea_ros.diagnosis.next_experiment import amplitude_series, separating_run
from rsea_ros.diagnosis.residual_analysis import misfits, spectrum
from rsea_ros.diagnosis.score import Score, gain, lost_above
from rsea_ros.diagnosis.settings import DEFAULT, DiagnosisSettings, SizeSettings
from rsea_ros.effects.catalogue import effect_named
from rsea_ros.errors import IdentificationError
from rsea_ros.identification import confidence as conf
from rsea_ros.identification.problem import Case
from rsea_ros.identification.result import ParameterEstimate, Remark
from rsea_ros.identification.solver import Pools, solve
from rsea_ros.model.prediction_errors import fit_percent
from rsea_ros.model.rig import CLOCK_DOUBT
from rsea_ros.records.record import MEASURED
from rsea_ros.records.statistics import Z95


def cause_of(
    step: tuple[Evaluated, Evaluated], last: Evaluated, channel: str, named: Named,
    settings: DiagnosisSettings,
) -> results.Cause:  # fmt: skip
    """Return an accepted cause: its parameters beside all causes, its gain on the test blocks.

    step: the models without and with it. last: the model with all causes. channel: preferred for its gain
    where its residual falls.
    """
    (without, with_it), effect = step, effect_named(step[1].added)
    before, after = without.test, with_it.test
    if not before.ratio(channel) > _FALL * after.ratio(channel):  # then the one whose residual falls most
        channel = max(before.sums, key=lambda n: before.ratio(n) / max(after.ratio(n), 1e-12))
    held_out, interval = gain(with_it.test, without.test, channel, settings.acceptance.resamples)
    train, _ = gain(with_it.train, without.train, channel)
    return results.Cause(
        name=effect.name,
        parameters=sizes(effect.name, conf.parameters_of(last.solution, last.confidence), settings.sizes),
        gain_train=train, gain_holdout=held_out, gain_holdout_ci95=interval,
        times_noise=(without.test.ratio(channel), with_it.test.ratio(channel)), equation=effect.equation,
        channel=channel, status=named.status or "leading", probability=named.probability,
        confusable_with=tuple(w.claim.name for w, _ in named.rivals) if named.status == "one_of" else (),
    )


_FALL = 1.02
"""Ratio by which a channel's residual must fall for the gain to speak of it: less is what acceptance.matters
calls nothing."""


def alternative_of(
    instead_of: str, weighed: Weighed, probability: float, settings: DiagnosisSettings
) -> results.Alternative:
    """Return a rival of a cause with its size where it acts in that cause's place."""
    claim, evidence = weighed.claim, weighed.evidence
    solution = solve(claim.problem, claim.theta, iterations=0)
    confidence = conf.confidence_of(solution)
    resamples = settings.acceptance.resamples
    held_out, interval = gain(claim.with_it, claim.without, evidence.channel, resamples)
    return results.Alternative(
        name=claim.name, instead_of=instead_of,
        parameters=sizes(claim.name, conf.parameters_of(solution, confidence), settings.sizes),
        gain_holdout=held_out, gain_holdout_ci95=interval, channel=evidence.channel,
        probability=probability,
    )


def sizes(
    effect: str, estimates: Sequence[ParameterEstimate], rule: SizeSettings
) -> dict[str, results.CauseParameter]:
    """Return the parameters of an effect among estimates, by their names without the effect's."""
    estimated = {p.name: p for p in estimates}
    known = [(p, estimated.get(f"{effect}.{p.name}")) for p in effect_named(effect).parameters]
    return {p.name: with_model_uncertainty(e, rule, p.low) for p, e in known if e is not None}


def needed_sizes(effect: str, last: Evaluated, rule: SizeSettings) -> list[results.CauseParameter]:
    """Return what a cause must have a size of: its main parameter, and other scales that it needs."""
    known = sizes(effect, conf.parameters_of(last.solution, last.confidence), rule)
    main, *others = effect_named(effect).parameters
    scales = [p.name for p in others if p.logarithmic and not p.optional and p.unit != "1"]
    return [known[name] for name in (main.name, *scales) if name in known]


def is_known(size: results.CauseParameter, rule: SizeSettings) -> bool:
    """Return whether a size is known: its interval has one sign, and its ends are not far apart."""
    low, high = sorted(map(abs, size.ci95))
    return size.ci95[0] * size.ci95[1] > 0.0 and high < rule.widest * low


def with_model_uncertainty(
    estimate: ParameterEstimate, rule: SizeSettings, least: float
) -> results.CauseParameter:
    """Return an estimate whose interval includes errors that no residual shows.

    The fit's interval covers noise only. Two right simulations of one bench differ by about `model_error`
    in a parameter (by their steps and smoothing of laws), and no time is known better than
    the sensors' clocks. The interval by noise alone is kept beside the whole one. least: the parameter's
    lower bound; where that is not negative, no end of the interval is.
    """
    value, sd = estimate.value, rule.model_error * abs(estimate.value)
    if estimate.unit == "s":
        sd = float(np.hypot(sd, CLOCK_DOUBT))
    low, high = (float(np.hypot(end - value, Z95 * sd)) for end in estimate.ci95)
    begin = max(value - low, 0.0) if least >= 0.0 else value - low
    return results.CauseParameter(value, estimate.unit, (begin, value + high), estimate.ci95, sd)


def latest(trials: Sequence[Trial]) -> list[Trial]:
    """Return the most thorough trial of each effect: one fitted to all training blocks, or the last."""
    best: dict[str, Trial] = {}
    for t in trials:
        if t.name not in best or t.is_full or not best[t.name].is_full:
            best[t.name] = t
    return list(best.values())


def rejected_trial(trial: Trial, held_out: HeldOut, channel: str) -> results.Rejected:
    """Return a trial with its gain over the model that it was tried beside."""
    size = gain(held_out.score(trial.problem, trial.theta), held_out.score_of(trial.beside), channel)[0]
    return results.Rejected(trial.name, size, trial.reason, trial.rival, trial.is_full)


def dropped_cause(
    without: Evaluated, with_it: Evaluated, naming: Mapping[str, Named], channel: str, reached: float
) -> results.Rejected:
    """Return an accepted effect that may not be named, with its gain in the channel that it helps most.

    reached: of the noise, up to which only that is left.
    """
    named = naming.get(with_it.added)
    if named is None:
        gained = gain(with_it.test, without.test, channel)[0]
        return results.Rejected(with_it.added, gained, "leaves_too_much")
    evidence = named.cause.evidence
    unsure: results.Reason = "leaves_too_much" if evidence.left > reached else "not_sure"
    reason: results.Reason = "improbable" if evidence.is_sure else unsure
    return results.Rejected(with_it.added, evidence.gain, reason, probability=named.probability)


def undetermined_play(
    selection: Selection, causes: Sequence[results.Cause], rejected: Sequence[results.Rejected]
) -> tuple[Remark, ...]:
    """Return the remark on play in a joint's log where it is not a cause, because users look for it."""
    if selection.last.problem.rig.loop is None or any(_is_play(cause.name) for cause in causes):
        return ()
    trials = [trial for trial in selection.trials if _is_play(trial.name)]
    gains = {effect.name: effect.gain_holdout for effect in rejected}
    if not trials or trials[-1].name not in gains:
        return ()
    gap, at = main_of(trials[-1].problem, trials[-1].theta, trials[-1].name)
    return (Remark("play_undetermined", values=(gap.outer(at), gains[trials[-1].name])),)


def _is_play(name: str) -> bool:
    return "play" in effect_named(name).tags


SURE_OF_BOUND = 0.25
"""Half an interval over the span between a parameter's bounds, below which the data hold it at one."""


@dataclass(frozen=True)
class Outcome:
    """The outcome of weighing the causes.

    channel: of verdict and gains. stages: models from the nominal one to the extended one.
    dropped: accepted effects that may not be named. named: by cause its status.
    """

    verdict: results.Verdict
    channel: str
    stages: Sequence[Evaluated]
    causes: tuple[results.Cause, ...]
    dropped: tuple[results.Rejected, ...]
    named: Mapping[str, Named]


def outcome_of(
    places: Sequence[Sequence[Weighed]], selection: Selection, stages: Sequence[Evaluated],
    examined: Examined, settings: DiagnosisSettings,
) -> Outcome:  # fmt: skip
    """Return the verdict on weighed causes, those that are named, and those that may not be."""
    levels = settings.floor
    channel = next((n for n in MEASURED if n in stages[0].test.sums), None)
    if channel is None:
        source = examined.records[0].source
        raise IdentificationError(f"{source}: no sample is left to test on, expected a longer record")
    naming = naming_of(places, stages, settings)
    steps = itertools.pairwise(stages)
    unnamed = [(a, b) for a, b in steps if not is_named(b, naming)]
    dropped = tuple(dropped_cause(a, b, naming, channel, levels.reached) for a, b in unnamed)
    stages = without_unnamed_end(stages, naming)
    naming = with_sizes_known(naming, stages, settings)
    statuses = [naming[s.added].status if s.added in naming else None for s in stages[1:]]
    verdict = verdict_of([s.test for s in stages], statuses, levels, examined.faults)
    if verdict == "unexplained":
        channel, stages = main_channel(stages[0].test, channel, levels.reached), stages[:1]
    causes = tuple(
        cause_of(step, stages[-1], channel, naming[step[1].added], settings)
        for step in itertools.pairwise(stages)
        if is_named(step[1], naming)
    )
    return Outcome(verdict, causes[0].channel if causes else channel, stages, causes, dropped, naming)


def naming_of(
    places: Sequence[Sequence[Weighed]], stages: Sequence[Evaluated], settings: DiagnosisSettings
) -> dict[str, Named]:
    """Return the naming of each cause."""
    *before, at_floor = (is_at_floor(stage.test, settings.floor) for stage in stages)
    steps = zip(stages[1:], before, strict=True)
    needed = {stage.added for stage, reached in steps if at_floor and not reached}
    return {n.cause.evidence.name: n for n in name_causes(places, at_floor, needed, settings)}


def with_sizes_known(
    naming: Mapping[str, Named], stages: Sequence[Evaluated], settings: DiagnosisSettings
) -> dict[str, Named]:
    """Return the naming with no cause confirmed whose law the last model leaves open.

    That is one of an unknown size or scale, one with a parameter at a bound, and every cause where the clock
    of a sensor is at its bound: there the fit would go on, and another law may be what it lacks.
    """
    last, near = stages[-1], settings.acceptance.near_bound
    known = zip(last.solution.problem.unknowns, last.solution.theta, strict=True)
    is_clock_bound = any(u.is_clock and u.is_near_bound(float(t), near) for u, t in known)

    def is_open(name: str) -> bool:
        is_sized = all(is_known(s, settings.sizes) for s in needed_sizes(name, last, settings.sizes))
        return is_clock_bound or not is_sized or is_held_by_bound(name, last, near)

    unclear = {s.added for s in stages[1:] if is_named(s, naming) and is_open(s.added)}
    return {
        name: replace(by, status="leading") if name in unclear and by.status == "confirmed" else by
        for name, by in naming.items()
    }


def is_held_by_bound(effect: str, last: Evaluated, near: float) -> bool:
    """Return whether a parameter of an effect ended at a bound that the law needs or the data determine.

    Not a share, which may be none and all, nor what vanishes there or is typical, nor where the law is ideal.
    """
    laws = {f"{effect}.{p.name}": p for p in effect_named(effect).parameters if not p.is_share}
    theta, doubts = last.solution.theta, np.sqrt(last.confidence.covariance.diagonal())
    fitted = zip(last.solution.problem.unknowns, theta, doubts, strict=True)
    return any(
        u.is_near_bound(float(at), near)
        and not any(math.isclose(u.outer(float(at)), v) for v in (laws[u.name].null, laws[u.name].typical))
        and not (laws[u.name].ideal_at_low and u.outer(float(at)) < math.sqrt(u.low * u.high))
        and (not laws[u.name].optional or Z95 * doubt < SURE_OF_BOUND * (u.inner(u.high) - u.inner(u.low)))
        for u, at, doubt in fitted
        if u.name in laws
    )


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


def conclude(
    selection: Selection, stages: Sequence[Evaluated], examined: Examined, pools: Pools,
    settings: DiagnosisSettings,
) -> results.Diagnosis:  # fmt: skip
    """Weigh and name the causes of a selection. stages: its models, evaluated."""
    places = weigh(selection, stages, held_out_data(selection, examined.holdout), pools, settings)
    outcome = outcome_of(places, selection, stages, examined, settings)
    return _diagnosis(selection, outcome, examined, pools, settings)


def _diagnosis(
    selection: Selection, outcome: Outcome, examined: Examined, pools: Pools, settings: DiagnosisSettings
) -> results.Diagnosis:
    """Return the diagnosis of an outcome, with rivals, rejected effects, and the curves of a report."""
    first, last, main = outcome.stages[0], outcome.stages[-1], outcome.channel
    case, records, rig = selection.cases[0], examined.records, examined.rig
    rejected = _rejections(selection, outcome, pools)
    baseline, final = (conf.parameters_of(s.solution, s.confidence) for s in (first, last))
    return results.Diagnosis(
        verdict=outcome.verdict,
        channel=main,
        rig_name=rig.name,
        sources=tuple(r.source for r in records),
        duration=sum(r.stop - r.start for r in records),
        rate=examined.rate,
        faults=examined.faults,
        baseline_rig=conf.identified_rig(first.solution, baseline),
        baseline=baseline,
        extended_rig=conf.identified_rig(last.solution, final),
        extended=final,
        noise_rms=dict(case.noise),
        residual_rms=_rms(first.test, case),
        fit_percent=_fit(first, selection.cases),
        extended_residual_rms=_rms(last.test, case),
        extended_fit_percent=_fit(last, selection.cases),
        at_noise_floor=is_at_floor(last.test, settings.floor),
        misfit=misfits(case, first.outputs[0], main, rig),
        causes=outcome.causes,
        alternatives=_alternatives(outcome, pools, settings),
        rejected=rejected,
        next_experiment=_next_experiment(selection, outcome, examined.rate, settings),
        remaining=misfits(case, last.outputs[0], main, rig),
        masked={n: ~counted for n, counted in case.mask.items()},
        settings=settings,
        before=conf.overlays_of(case, first.outputs[0]),
        after=conf.overlays_of(case, last.outputs[0]),
        spectra=tuple(spectrum(case, first.outputs[0], last.outputs[0], n) for n in first.test.sums),
        remarks=(
            *conf.off_rig(final),
            *undetermined_play(selection, outcome.causes, rejected),
            *_remarks(outcome, case),
        ),
    )


def _alternatives(
    outcome: Outcome, pools: Pools, settings: DiagnosisSettings
) -> tuple[results.Alternative, ...]:
    """Return the rivals of the named causes, each with its size."""

    def alternative(rival: tuple[str, Weighed, float]) -> results.Alternative:
        return alternative_of(*rival, settings)

    rivals = [(c.name, weighed, p) for c in outcome.causes for weighed, p in outcome.named[c.name].rivals]
    return tuple(pools.fits.map(alternative, rivals))


def _rejections(selection: Selection, outcome: Outcome, pools: Pools) -> tuple[results.Rejected, ...]:
    """Return the accepted effects that may not be named, then all others that were tried."""
    decided = {c.name for c in outcome.causes} | {r.name for r in outcome.dropped}
    others = [t for t in latest(selection.trials) if t.name not in decided]
    test_blocks = held_out_data(selection, None)
    rejected = pools.fits.map(lambda t: rejected_trial(t, test_blocks, outcome.channel), others)
    return (*outcome.dropped, *rejected)


def _remarks(outcome: Outcome, case: Case) -> list[Remark]:
    """Return the remarks on values that the data cannot determine and on the extended model."""
    last = outcome.stages[-1].solution.problem
    named = {c.name for c in outcome.causes}
    unnamed = tuple(n for n in last.added if n not in named)
    lost, channel = lost_above(case, outcome.channel), outcome.channel
    return [
        *([Remark("also_in_model", unnamed)] if unnamed else []),
        *conf.undetermined_remarks(last.unknowns, outcome.stages[-1].confidence),
        *([Remark("coherence_lost", (channel,), (lost,), "Hz")] if lost is not None else []),
        *([Remark("on_measured_angle")] if last.on_angle else []),
        *([Remark("coloured_noise", tuple(sorted(case.coloured)))] if case.coloured else []),
    ]


def _next_experiment(
    selection: Selection, outcome: Outcome, rate: float, settings: DiagnosisSettings
) -> results.Experiment | None:
    """Return the run that would decide an open question; None without one. rate: of its commands, Hz."""
    last = outcome.stages[-1]
    for cause in outcome.causes:
        if cause.confusable_with:
            named = outcome.named[cause.name]
            claims = [named.cause.claim, *(rival.claim for rival, _ in named.rivals)]
            problems = [replace(c.problem, newest=c.name) for c in claims]
            ends = [solve(p, c.theta, iterations=0) for p, c in zip(problems, claims, strict=True)]
            return separating_run(ends[0], ends[1:], rate)
    if outcome.verdict in ("unexplained", "partly_explained") and not is_at_floor(last.test, settings.floor):
        return amplitude_series(last.solution, last.test.ratio(last.test.worst), rate)
    return None


def _rms(test: Score, case: Case) -> dict[str, float]:
    return {n: test.ratio(n) * case.noise[n] for n in test.sums}


def _fit(stage: Evaluated, cases: tuple[Case, ...]) -> dict[str, float]:
    """Return the fit of every channel on all valid samples, %."""
    case, out = cases[0], stage.outputs[0]
    keep = {n: case.mask[n] for n in stage.test.sums if n in case.measured}
    return {n: fit_percent((out[n] - case.measured[n])[k], case.measured[n][k]) for n, k in keep.items()}
