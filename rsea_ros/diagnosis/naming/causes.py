"""The facts about each effect: of a cause its size, gain and rivals; of any other why it is no cause."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from rsea_ros.diagnosis.data_split import TEST
from rsea_ros.diagnosis.evaluation import Evaluated
from rsea_ros.diagnosis.naming.status import Named
from rsea_ros.diagnosis.naming.weighing import Weighed
from rsea_ros.diagnosis.result import Alternative, Cause, Diagnosis, Estimate, Reason, Rejected
from rsea_ros.diagnosis.score import gain, score_on
from rsea_ros.diagnosis.selection import Selection, Trial
from rsea_ros.diagnosis.sentences import evidence_of
from rsea_ros.effects.catalogue import effect_named
from rsea_ros.identification.confidence import confidence_of
from rsea_ros.identification.identify import parameters_of
from rsea_ros.identification.problem import Case
from rsea_ros.identification.result import ParameterEstimate
from rsea_ros.identification.solver import solve
from rsea_ros.model.rig import CLOCK_DOUBT

MODEL_DOUBT = 0.0025
"""Relative, one sigma: measured between the simulation and the second bench in test/independent."""
_FALLS = 1.02
"""Ratio by which a channel's residual must fall for a cause's gain to speak of that channel."""
PLAY = "backlash"
_GAP = f"{PLAY}.gap"


def cause_of(
    selection: Selection,
    without: Evaluated,
    with_it: Evaluated,
    last: Evaluated,
    channel: str,
    said: Named,
) -> Cause:
    """Return an accepted cause: its parameters beside all causes, its gain on the test blocks."""
    effect = effect_named(with_it.added)
    speaks = (
        channel
        if without.test.ratio(channel) > _FALLS * with_it.test.ratio(channel)
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


def alternative_of(instead_of: str, weighed: Weighed, probability: float) -> Alternative:
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
    parameters = [p for p in estimates if p.name.startswith(effect + ".")]
    return {p.name.split(".")[1]: with_model_uncertainty(p) for p in parameters}


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


def latest(trials: Sequence[Trial]) -> list[Trial]:
    """Return each effect's trial that says most: one fitted to everything, else the last."""
    best: dict[str, Trial] = {}
    for t in trials:
        if t.name not in best or t.is_full or not best[t.name].is_full:
            best[t.name] = t
    return list(best.values())


def rejected_of(trial: Trial, cases: tuple[Case, ...], channel: str) -> Rejected:
    """Return a trial with its gain, on the test blocks over the model that it was tried beside."""
    problem = replace(trial.problem, cases=cases)
    with_it = score_on(problem, cases, TEST, problem.outputs(trial.theta))
    without = score_on(problem, cases, TEST, trial.beside.outputs)
    size = gain(with_it, without, channel)[0]
    return Rejected(trial.name, size, trial.reason, trial.rival, trial.is_full)


def dropped_of(
    without: Evaluated, with_it: Evaluated, said: Mapping[str, Named], channel: str
) -> Rejected:
    """Return an effect that was accepted and may not be named, with the gain of what it helps most."""
    weighed = said.get(with_it.added)
    if weighed is None:
        return Rejected(with_it.added, gain(with_it.test, without.test, channel)[0], "leaves_too_much")
    evidence = weighed.cause.evidence
    reason: Reason = "improbable" if evidence.is_sure else "leaves_too_much"
    return Rejected(with_it.added, evidence.gain, reason, probability=weighed.probability)


def play_not_told(selection: Selection, result: Diagnosis) -> tuple[str, ...]:
    """Return the sentence for a joint in a position loop whose play these data do not show."""
    named = {cause.name for cause in result.causes}
    trials = [trial for trial in selection.trials if trial.name == PLAY]
    gains = [rejected.gain_holdout for rejected in result.rejected if rejected.name == PLAY]
    if result.baseline_rig.loop is None or PLAY in named or not (trials and gains):
        return ()
    unknowns = zip(trials[-1].problem.unknowns, trials[-1].theta, strict=True)
    gap = next(u.outer(float(value)) for u, value in unknowns if u.name == _GAP)
    return (
        f"These data cannot determine the play in the gear: with {1e3 * gap:.2g} mrad, which fits best, the "
        f"residual of data that took no part changes by {-100.0 * gains[-1]:+.1f} %.",
    )
