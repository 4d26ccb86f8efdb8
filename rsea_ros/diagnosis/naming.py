"""Naming: which causes may be named, with which status, and what stands against each.

A cause and its rivals share the probability that one of them is right; the rest is "none of these". What
surely takes a part that counts is named unless that is four times as likely; what helps less, where that is
less likely. Causes that together take most of the residual, or all of it, are always named, but as `confirmed`
only where they are likely.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from rsea_ros.diagnosis.coefficients import COEFFICIENTS
from rsea_ros.diagnosis.evidence import Evidence
from rsea_ros.diagnosis.probability import probability
from rsea_ros.diagnosis.result import Status
from rsea_ros.diagnosis.weighing import Place, Weighed

CONFIRMED_AT_FLOOR = 0.8
"""Probability from which a cause that takes the residual to the floor with its siblings is confirmed."""
CONFIRMED = 0.98
"""Probability from which one is confirmed although more is missing: two wrong names in a hundred."""
LIKELY = 0.5
"""Probability of a cause and its rivals from which it is named if it surely helps at all."""
POSSIBLE = 0.2
"""Probability from which one is named that surely takes what counts: less than four to one against it."""
COUNTS = 0.1
"""Share of a channel's residual that counts, as in the steps of the search (criteria.py)."""
RIVAL = 0.05
"""Probability from which a rival is told of."""
CLEAR = 0.8
"""Share of the probability of all that stand in one place from which the first is no `one_of`."""


@dataclass(frozen=True)
class Named:
    """A weighed cause with its probability and status (None: not to be named), and its rivals with theirs."""

    cause: Weighed
    probability: float
    status: Status | None
    rivals: tuple[tuple[Weighed, float], ...]


def named(places: Sequence[Place], at_floor: bool, takes_most: bool) -> list[Named]:
    """Return what may be said of the cause in each place. at_floor, takes_most: all causes together."""
    return [_named(place, at_floor, takes_most) for place in places]


def _named(place: Place, at_floor: bool, takes_most: bool) -> Named:
    every = [place.cause, *place.rivals]
    likely, status = standing([w.evidence for w in every], at_floor, takes_most and not place.is_late)
    rivals = tuple((w, p) for w, p in zip(every[1:], likely[1:], strict=True) if p >= RIVAL)
    return Named(place.cause, likely[0], status, rivals)


def standing(
    evidence: Sequence[Evidence],
    at_floor: bool,
    takes_most: bool,
    coefficients: Mapping[str, float] = COEFFICIENTS,
) -> tuple[list[float], Status | None]:
    """Return the probability of a cause and of each of its rivals, and the status of the cause.

    evidence: of the cause, then of its rivals. At most one of them is right: together they have at most 1.
    """
    likely = [probability(e, k == 0, coefficients) for k, e in enumerate(evidence)]
    likely = [p / max(1.0, sum(likely)) for p in likely]
    rivals = [p for p in likely[1:] if p >= RIVAL]
    mass = likely[0] + sum(rivals)
    return likely, status_of(likely[0], rivals, at_floor, takes_most or _helps(mass, evidence[0]))


def _helps(mass: float, evidence: Evidence) -> bool:
    """Tell whether a cause surely helps enough for the probability of it and its rivals."""
    return evidence.is_sure and mass >= (POSSIBLE if evidence.gain_low >= COUNTS else LIKELY)


def status_of(p: float, rivals: Sequence[float], at_floor: bool, helps: bool) -> Status | None:
    """Return the status of a cause of probability p beside rivals; None where it is not to be named."""
    if not (at_floor or helps):
        return None
    if rivals and p < CLEAR * (p + sum(rivals)):
        return "one_of"
    return "confirmed" if p >= (CONFIRMED_AT_FLOOR if at_floor else CONFIRMED) else "leading"
