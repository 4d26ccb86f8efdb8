"""Probability of a cause from its evidence, and the status that follows from it.

A cause and its rivals share the probability that one of them is right; the rest is "none of these". A cause
that surely takes a material part is named unless "none of these" is four times as likely; one that helps
less, where it is likelier than that. Causes without which more than noise is left are always named, but as
`confirmed` only where they are likely.

p = 1 / (1 + exp(-(a_0 + sum_i a_i f_i)))

The features f are the fit of the law's shape (evidence.py), the further gain of a flexible law
(flexible.py), its odds among its rivals (weighing.py), and its gain. The coefficients are those of
`python -m bench calibration fit`; "none of these" is the mass that a cause and its rivals leave.

Written by `python -m bench calibration fit`, from records of the project's own plants; `score` tests them.
"""

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

from rsea_ros.diagnosis.naming.evidence import Evidence
from rsea_ros.diagnosis.naming.weighing import Weighed
from rsea_ros.diagnosis.result import Status
from rsea_ros.diagnosis.settings import DEFAULT, DiagnosisSettings, NamingSettings
from rsea_ros.records.statistics import Z95

COEFFICIENTS = MappingProxyType(
    {
        "intercept": -1.9062,
        "shape": -0.5554,
        "rivals": 0.5793,
        "preferred": 2.3893,
        "noise": 0.5576,
        "flexible": -2.9564,
        "edge": -1.0734,
    }
)


INTERCEPT = "intercept"
_CERTAIN = 30.0
"""Log odds from which no number of this machine differs from certainty."""
_LEAST_SPREAD, _MOST_SPREAD, _SUREST = 3e-3, 3.0, 4.0
"""Spread of lambda that two right simulations of one law have, and above which it says no more; log odds
among rivals above which they say no more, since all may be wrong. Fixed when the coefficients were fitted."""


def features(e: Evidence, preferred: bool, settings: DiagnosisSettings = DEFAULT) -> dict[str, float]:
    """Return the numbers that the logistic model weighs, by name. preferred: the search chose it.

    shape: spread of lambda. rivals: log odds among them, reduced with the distance from the noise floor,
    because the residual there is not noise, and more parameters always fit a little of it. noise: its model
    leaves only noise. flexible: sure gain of a spline beside it. edge: a parameter is at a bound.
    """
    s, flexible = e.signature, e.flexible
    bent, inside = max(s.amplitude, s.time, s.frequency), min(max(e.weight, 1e-9), 1.0 - 1e-9)
    log_odds = min(max(math.log(inside / (1.0 - inside)), -_SUREST), _SUREST)
    return {
        INTERCEPT: 1.0,
        "shape": 0.5 * (_relative(s.overall) + _relative(bent)),
        "rivals": log_odds / max(e.left, 1.0),
        "preferred": float(preferred),
        "noise": float(e.left <= settings.floor.reached),
        "flexible": flexible.gain if flexible and flexible.ci95[0] > 0.0 else 0.0,
        "edge": float(e.at_edge),
    }


def _relative(spread: float) -> float:
    """Return the logarithm of a spread of lambda over 0.1."""
    return math.log((_LEAST_SPREAD + min(spread, _MOST_SPREAD)) / 0.1)


def probability(
    e: Evidence, preferred: bool, coefficients: Mapping[str, float] = COEFFICIENTS,
    settings: DiagnosisSettings = DEFAULT,
) -> float:  # fmt: skip
    """Return the probability that the cause is part of the truth under its name, 0 to 1."""
    odds = sum(coefficients[name] * value for name, value in features(e, preferred, settings).items())
    return 1.0 / (1.0 + math.exp(-min(max(odds, -_CERTAIN), _CERTAIN)))


@dataclass(frozen=True)
class Named:
    """A weighed cause with its probability and status (None: not to be named), and its rivals with theirs."""

    cause: Weighed
    probability: float
    status: Status | None
    rivals: tuple[tuple[Weighed, float], ...]


def name_causes(
    places: Sequence[Sequence[Weighed]], at_floor: bool, needed: Collection[str],
    settings: DiagnosisSettings = DEFAULT,
) -> list[Named]:  # fmt: skip
    """Return the naming of the cause in each place, the first of its place; its rivals follow.

    at_floor: all causes together leave only noise (criteria.py). needed: the causes for which they do.
    """
    return [_name_one(p, at_floor, p[0].evidence.name in needed, settings) for p in places]


def _name_one(
    place: Sequence[Weighed], at_floor: bool, is_needed: bool, settings: DiagnosisSettings
) -> Named:
    evidence = [w.evidence for w in place]
    likely, status = probabilities_and_status(evidence, at_floor, settings, is_needed=is_needed)
    others = zip(place[1:], likely[1:], strict=True)
    rivals = tuple((w, p) for w, p in others if p >= settings.naming.rival)
    return Named(place[0], likely[0], status, rivals)


def probabilities_and_status(
    evidence: Sequence[Evidence], at_floor: bool, settings: DiagnosisSettings = DEFAULT,
    coefficients: Mapping[str, float] = COEFFICIENTS, *, is_needed: bool = True,
) -> tuple[list[float], Status | None]:  # fmt: skip
    """Return the probability of a cause and of each of its rivals, and the status of the cause.

    evidence: of the cause, then of its rivals. At most one of them is right: together they have at most 1.
    is_needed: without the cause more than noise is left.
    """
    likely = [probability(e, k == 0, coefficients, settings) for k, e in enumerate(evidence)]
    likely = [p / max(1.0, sum(likely)) for p in likely]
    rivals = [p for p in likely[1:] if p >= settings.naming.rival]
    is_named = (at_floor and is_needed) or _helps(likely[0] + sum(rivals), evidence[0], settings)
    status = status_of(likely[0], rivals, at_floor, settings.naming) if is_named else None
    sign, errors = evidence[0].signature, Z95 * settings.sizes.model_error
    wanders = at_floor and sign.carried > settings.naming.carried and sign.lasting > errors
    return likely, "leading" if wanders and status == "confirmed" else status


def _helps(mass: float, evidence: Evidence, settings: DiagnosisSettings) -> bool:
    """Return whether a cause surely helps, by enough for the probability of it and its rivals.

    A cause with a parameter at a bound may imitate another one, so it must be likely.
    """
    rule = settings.naming
    brings = evidence.gain_low >= settings.acceptance.fall and not evidence.at_edge
    return evidence.is_sure and mass >= (rule.possible if brings else rule.likely)


def status_of(p: float, rivals: Sequence[float], at_floor: bool, rule: NamingSettings) -> Status:
    """Return the status of a cause of probability p that is named beside rivals."""
    if rivals and p < rule.clear * (p + sum(rivals)):
        return "one_of"
    return "confirmed" if p >= (rule.confirmed_at_floor if at_floor else rule.confirmed) else "leading"
