"""Naming: which causes may be named, with which status, and the rivals of each.

A cause and its rivals share the probability that one of them is right; the rest is "none of these". A cause
that surely takes a material part is named unless "none of these" is four times as likely; one that helps
less, where it is likelier than that. Causes that together take most of the residual, or all of it, are always
named, but as `confirmed` only where they are likely.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from rsea_ros.diagnosis.naming.coefficients import COEFFICIENTS
from rsea_ros.diagnosis.naming.evidence import Evidence
from rsea_ros.diagnosis.naming.probability import probability
from rsea_ros.diagnosis.naming.weighing import CauseAndRivals, Weighed
from rsea_ros.diagnosis.result import Status
from rsea_ros.diagnosis.settings import DEFAULT, DiagnosisSettings, NamingSettings


@dataclass(frozen=True)
class Named:
    """A weighed cause with its probability and status (None: not to be named), and its rivals with theirs."""

    cause: Weighed
    probability: float
    status: Status | None
    rivals: tuple[tuple[Weighed, float], ...]


def name_causes(
    places: Sequence[CauseAndRivals],
    at_floor: bool,
    takes_most: bool,
    settings: DiagnosisSettings = DEFAULT,
) -> list[Named]:
    """Return the naming of the cause in each place.

    at_floor, takes_most: all causes together leave only noise, or take most of the residual (criteria.py).
    """
    return [_name_one(p, at_floor, takes_most and not p.is_late, settings) for p in places]


def _name_one(place: CauseAndRivals, at_floor: bool, takes_most: bool, settings: DiagnosisSettings) -> Named:
    every = [place.cause, *place.rivals]
    likely, status = probabilities_and_status([w.evidence for w in every], at_floor, takes_most, settings)
    others = zip(every[1:], likely[1:], strict=True)
    rivals = tuple((w, p) for w, p in others if p >= settings.naming.rival)
    return Named(place.cause, likely[0], status, rivals)


def probabilities_and_status(
    evidence: Sequence[Evidence],
    at_floor: bool,
    takes_most: bool,
    settings: DiagnosisSettings = DEFAULT,
    coefficients: Mapping[str, float] = COEFFICIENTS,
) -> tuple[list[float], Status | None]:
    """Return the probability of a cause and of each of its rivals, and the status of the cause.

    evidence: of the cause, then of its rivals. At most one of them is right: together they have at most 1.
    """
    likely = [probability(e, k == 0, coefficients, settings) for k, e in enumerate(evidence)]
    likely = [p / max(1.0, sum(likely)) for p in likely]
    rivals = [p for p in likely[1:] if p >= settings.naming.rival]
    is_named = at_floor or takes_most or _helps(likely[0] + sum(rivals), evidence[0], settings)
    status = status_of(likely[0], rivals, at_floor, settings.naming) if is_named else None
    wanders = at_floor and evidence[0].signature.carried > settings.naming.carried
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
