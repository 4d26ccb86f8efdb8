"""The facts about each effect: of a cause its size, gain and rivals; of any other why it is no cause."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from rsea_ros.diagnosis.evaluation import Evaluated, HeldOut, Selection, Trial
from rsea_ros.diagnosis.naming.status import Named
from rsea_ros.diagnosis.naming.weighing import Weighed
from rsea_ros.diagnosis.result import Alternative, Cause, CauseParameter, Reason, Rejected
from rsea_ros.diagnosis.score import Score, gain
from rsea_ros.diagnosis.settings import DiagnosisSettings, SizeSettings
from rsea_ros.effects.catalogue import effect_named
from rsea_ros.identification.confidence import confidence_of
from rsea_ros.identification.estimates import parameters_of
from rsea_ros.identification.result import ParameterEstimate, Remark
from rsea_ros.identification.solver import solve
from rsea_ros.model.rig import CLOCK_DOUBT
from rsea_ros.records.normal import Z95


def cause_of(
    step: tuple[Evaluated, Evaluated],
    last: Evaluated,
    channel: str,
    named: Named,
    settings: DiagnosisSettings,
) -> Cause:
    """Return an accepted cause: its parameters beside all causes, its gain on the test blocks.

    step: the models without and with it. last: the model with all causes. channel: preferred for its gain
    where its residual falls.
    """
    (without, with_it), effect = step, effect_named(step[1].added)
    rule, resamples = settings.sizes, settings.acceptance.resamples
    channel = _helped_channel(without.test, with_it.test, channel, rule)
    held_out, interval = gain(with_it.test, without.test, channel, resamples)
    train, _ = gain(with_it.train, without.train, channel)
    return Cause(
        name=effect.name,
        parameters=sizes(effect.name, parameters_of(last.solution, last.confidence), rule),
        gain_train=train,
        gain_holdout=held_out,
        gain_holdout_ci95=interval,
        times_noise=(without.test.ratio(channel), with_it.test.ratio(channel)),
        equation=effect.equation,
        channel=channel,
        status=named.status or "leading",
        probability=named.probability,
    )


def _helped_channel(without: Score, with_it: Score, channel: str, rule: SizeSettings) -> str:
    """Return a channel if its residual falls, else the one whose residual falls most."""
    if without.ratio(channel) > rule.fall * with_it.ratio(channel):
        return channel
    return max(without.sums, key=lambda n: without.ratio(n) / max(with_it.ratio(n), 1e-12))


def alternative_of(
    instead_of: str, weighed: Weighed, probability: float, settings: DiagnosisSettings
) -> Alternative:
    """Return a rival of a cause with its size where it acts in that cause's place."""
    claim, evidence = weighed.claim, weighed.evidence
    solution = solve(claim.problem, claim.theta, iterations=0)
    confidence = confidence_of(solution, rule=settings.intervals)
    resamples = settings.acceptance.resamples
    held_out, interval = gain(claim.with_it, claim.without, evidence.channel, resamples)
    return Alternative(
        name=claim.name,
        instead_of=instead_of,
        parameters=sizes(claim.name, parameters_of(solution, confidence), settings.sizes),
        gain_holdout=held_out,
        gain_holdout_ci95=interval,
        channel=evidence.channel,
        probability=probability,
    )


def sizes(
    effect: str, estimates: Sequence[ParameterEstimate], rule: SizeSettings
) -> dict[str, CauseParameter]:
    """Return the parameters of an effect among estimates, by their names without the effect's."""
    estimated = {p.name: p for p in estimates}
    known = [(p, estimated.get(f"{effect}.{p.name}")) for p in effect_named(effect).parameters]
    return {p.name: with_model_uncertainty(e, rule, p.low) for p, e in known if e is not None}


def size_of(effect: str, last: Evaluated, rule: SizeSettings) -> CauseParameter:
    """Return the size of an effect in a model: its main parameter."""
    return sizes(effect, parameters_of(last.solution, last.confidence), rule)[effect_named(effect).main.name]


def is_known(size: CauseParameter, rule: SizeSettings) -> bool:
    """Return whether a size is known: its interval has one sign, and its ends are not far apart."""
    low, high = sorted(map(abs, size.ci95))
    return size.ci95[0] * size.ci95[1] > 0.0 and high < rule.widest * low


def with_model_uncertainty(estimate: ParameterEstimate, rule: SizeSettings, least: float) -> CauseParameter:
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
    return CauseParameter(value, estimate.unit, (begin, value + high), estimate.ci95, sd)


def latest(trials: Sequence[Trial]) -> list[Trial]:
    """Return the most thorough trial of each effect: one fitted to all training blocks, or the last."""
    best: dict[str, Trial] = {}
    for t in trials:
        if t.name not in best or t.is_full or not best[t.name].is_full:
            best[t.name] = t
    return list(best.values())


def rejected_trial(trial: Trial, held_out: HeldOut, channel: str) -> Rejected:
    """Return a trial with its gain over the model that it was tried beside."""
    size = gain(held_out.score(trial.problem, trial.theta), held_out.score_of(trial.beside), channel)[0]
    return Rejected(trial.name, size, trial.reason, trial.rival, trial.is_full)


def dropped_cause(
    without: Evaluated, with_it: Evaluated, naming: Mapping[str, Named], channel: str
) -> Rejected:
    """Return an accepted effect that may not be named, with its gain in the channel that it helps most."""
    named = naming.get(with_it.added)
    if named is None:
        return Rejected(with_it.added, gain(with_it.test, without.test, channel)[0], "leaves_too_much")
    evidence = named.cause.evidence
    reason: Reason = "improbable" if evidence.is_sure else "leaves_too_much"
    return Rejected(with_it.added, evidence.gain, reason, probability=named.probability)


def undetermined_play(
    selection: Selection, causes: Sequence[Cause], rejected: Sequence[Rejected]
) -> tuple[Remark, ...]:
    """Return the remark on play in a joint's log where it is not a cause, because users look for it."""
    if selection.last.problem.rig.loop is None or any(_is_play(cause.name) for cause in causes):
        return ()
    trials = [trial for trial in selection.trials if _is_play(trial.name)]
    gains = {effect.name: effect.gain_holdout for effect in rejected}
    if not trials or trials[-1].name not in gains:
        return ()
    return (Remark("play_undetermined", values=(_gap(trials[-1]), gains[trials[-1].name])),)


def _is_play(name: str) -> bool:
    return "play" in effect_named(name).tags


def _gap(trial: Trial) -> float:
    """Return the gap of a trial with play, rad."""
    main = f"{trial.name}.{effect_named(trial.name).main.name}"
    unknowns = zip(trial.problem.unknowns, trial.theta, strict=True)
    return next(u.outer(float(value)) for u, value in unknowns if u.name == main)
