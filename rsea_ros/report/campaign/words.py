"""The result of a session of experiments in sentences."""

from __future__ import annotations

import math

from rsea_ros.diagnosis.settings import DEFAULT
from rsea_ros.effects.catalogue import effect_named
from rsea_ros.experiment.campaign import CampaignOutcome
from rsea_ros.experiment.hypothesis import NOTHING
from rsea_ros.experiment.joint_weighing import RunWeighing
from rsea_ros.model.rig import CLOCK_DOUBT
from rsea_ros.report import words
from rsea_ros.report.experiment.words import plain_name
from rsea_ros.wording import list_names

_SHOWN = 0.01


def known_causes(weighing: RunWeighing) -> str:
    """Return the likeliest causes with their probabilities."""
    order = sorted(weighing.probability.items(), key=lambda item: -item[1])
    return "known: " + ", ".join(f"{plain_name(n)} {p:.2f}" for n, p in order if p >= _SHOWN)


def size(weighing: RunWeighing, name: str) -> str:
    """Return a cause's main parameter with one sigma, the simulation's own doubt included; empty for none."""
    if name == NOTHING:
        return ""
    main = effect_named(name).main
    hypothesis = next(h for h in weighing.hypotheses() if h.name == name)
    k = [u.name for u in hypothesis.problem.unknowns].index(f"{name}.{main.name}")
    unknown, at = hypothesis.problem.unknowns[k], float(hypothesis.theta[k])
    sd = float(hypothesis.sd()[k])
    value = unknown.outer(at)
    noise = abs(unknown.outer(at + sd) - unknown.outer(at - sd)) / 2.0
    clock = CLOCK_DOUBT if main.unit == "s" else 0.0
    spread = math.hypot(noise, DEFAULT.sizes.model_error * value, clock)
    unit = "" if main.unit == "1" else f" {words.unit(main.unit)}"
    return f"{main.name.replace('_', ' ')} {value:.4g} ± {spread:.2g}{unit}"


def end_sentence(outcome: CampaignOutcome) -> str:
    """Return how a session ended."""
    cause, p = outcome.cause, outcome.weighing.probability[outcome.cause]
    spent = f"after {outcome.seconds:.3g} s of excitation in {_runs(outcome)}"
    match outcome.end:
        case "confirmed":
            return f"{plain_name(cause)}, {size(outcome.weighing, cause)}: probability {p:.3f} {spent}"
        case "nothing_wrong":
            return f"No cause: the rig with fitted values explains everything, probability {p:.3f} {spent}"
        case "unexplained":
            return (
                f"None of the causes explains the runs {spent}: the best, {plain_name(cause)}, leaves "
                f"{outcome.weighing.left:.2f} times the noise"
            )
        case "undecidable":
            return f"No further run would help: {_open(outcome)} remain possible {spent}"
        case "spent":
            return f"The budget is spent {spent}: {_open(outcome)} remain possible"
        case "declined":
            return f"The next run was declined {spent}: {_open(outcome)} remain possible"
        case "broken":
            return (
                f"A run was aborted ({outcome.why}) and is not used; {_open(outcome)} remain possible"
            )
        case _:
            return f"The session could not continue ({outcome.why}): {_open(outcome)} remain possible"


def _runs(outcome: CampaignOutcome) -> str:
    count = sum(r.proposal is not None for r in outcome.rounds)
    return "1 run" if count == 1 else f"{count} runs"


def _open(outcome: CampaignOutcome) -> str:
    order = sorted(outcome.weighing.probability.items(), key=lambda item: -item[1])
    return list_names([f"{plain_name(n)} ({p:.2f})" for n, p in order if p >= 0.05])
