"""The result of a session of experiments in sentences."""

from __future__ import annotations

import math

from rsea_ros.diagnosis.settings import DEFAULT
from rsea_ros.documents.wording import list_names
from rsea_ros.effects.catalogue import effect_named
from rsea_ros.experiment.campaign import CampaignOutcome
from rsea_ros.experiment.hypothesis import NOTHING
from rsea_ros.experiment.joint_weighing import RunWeighing
from rsea_ros.model.rig import CLOCK_DOUBT
from rsea_ros.records.statistics import Z95
from rsea_ros.report import words
from rsea_ros.report.experiment.words import plain_name

_SHOWN = 0.01


def known_causes(weighing: RunWeighing) -> str:
    """Return the likeliest causes with their probabilities."""
    order = sorted(weighing.probability.items(), key=lambda item: -item[1])
    return "known: " + ", ".join(f"{plain_name(n)} {p:.2f}" for n, p in order if p >= _SHOWN)


def size(weighing: RunWeighing, name: str) -> str:
    """Return a cause's main parameter with its 95 % interval, as a diagnosis states it; empty for no cause.

    The simulation's own doubt is included.
    """
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
    half = Z95 * math.hypot(noise, DEFAULT.sizes.model_error * value, clock)
    factor, unit = words.unit_factor(value, main.unit)
    number, doubt = words.with_doubt(*(factor * v for v in (value, value - half, value + half)))
    return f"{main.name.replace('_', ' ')} {number}{doubt} {'' if main.unit == '1' else unit}".rstrip()


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
        case "undecidable" if outcome.shared is not None:
            return shared_words(outcome, f" {spent}")
        case "undecidable":
            return f"No further run would help: {_open(outcome)} remain possible {spent}"
        case "spent":
            return f"The budget is spent {spent}: {_open(outcome)} remain possible"
        case "declined":
            return f"The next run was declined {spent}: {_open(outcome)} remain possible"
        case "broken":
            return f"A run was aborted ({outcome.why}) and is not used; {_open(outcome)} remain possible"
        case _:
            return f"The session could not continue ({outcome.why}): {_open(outcome)} remain possible"


def shared_words(outcome: CampaignOutcome, spent: str = "") -> str:
    """Return which causes share the name, and what would tell them apart. spent: after what, in words."""
    assert outcome.shared is not None
    names, torque = outcome.shared.names, outcome.shared.torque
    of = outcome.weighing.probability
    head = " or ".join(f"{plain_name(n)} ({of[n]:.2f})" for n in names)
    needed = "" if torque is None else f"; it takes at least about {torque:.2g} N·m"
    return f"{head}: no run within the limits shows which{spent}{needed}"


def _runs(outcome: CampaignOutcome) -> str:
    return " ".join(run_count(outcome))


def run_count(outcome: CampaignOutcome) -> tuple[str, str]:
    """Return how many runs were played, and their noun: ("1", "run")."""
    count = sum(r.proposal is not None for r in outcome.rounds)
    return str(count), "run" if count == 1 else "runs"


def _open(outcome: CampaignOutcome) -> str:
    order = sorted(outcome.weighing.probability.items(), key=lambda item: -item[1])
    return list_names([f"{plain_name(n)} ({p:.2f})" for n, p in order if p >= 0.05])
