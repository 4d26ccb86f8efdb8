"""What the missing torque depends on: laws without a form, each over other variables, judged held out.

A spline over each variable (or terms of its past) is fitted beside all that the rig's own values can do;
its share is what it takes of the power that is left above the noise. Then every other variable is added to
the best one: what gains beyond its standard error belongs to it, else it is that variable and nothing else.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rsea_ros.laws.candidates import Candidate
from rsea_ros.laws.gram import SELECTION, Gram
from rsea_ros.laws.selection import standard_error
from rsea_ros.laws.terms import Place
from rsea_ros.signals import FloatArray

_RIDGE = 1e-4
"""Of each part's power: a spline of many parts must not fit the noise."""


@dataclass(frozen=True)
class Dependence:
    """How much of what is left is a function of something. share: of the power above the noise, held out.

    se: its standard error. beside: what it adds where the best one acts already, with its error.
    """

    place: Place
    regressor: str
    share: float
    se: float
    beside: float = 0.0
    beside_se: float = 0.0


def families(candidates: Sequence[Candidate], first: int) -> dict[tuple[Place, str], list[int]]:
    """Return the columns of every law without a form: of splines, and of memories where no spline can be."""
    made: dict[tuple[Place, str], list[int]] = {}
    for k, c in enumerate(candidates):
        if c.part is not None:
            made.setdefault((c.place, c.regressor), []).append(first + k)
    for k, c in enumerate(candidates):
        if c.term is not None and ((c.place, c.regressor) not in made or c.term.memory or c.term.shape == "cycles_per_revolution"):
            made.setdefault((c.place, c.regressor), []).append(first + k)
    return made


def dependences(gram: Gram, candidates: Sequence[Candidate]) -> tuple[Dependence, ...]:
    """Return how much of what is left depends on what, most first."""
    made = families(candidates, len(gram.prior))
    none = gram.held_out(np.array([], np.int64))
    left = {key: gram.held_out(np.array(columns), _RIDGE) for key, columns in made.items()}
    weight = gram.weights(none, SELECTION)
    room = max(float(((none - gram.count)[SELECTION] @ weight).sum()), 1e-9)

    def share(before: FloatArray, after: FloatArray) -> tuple[float, float]:
        gain = (before - after)[SELECTION] @ weight
        return float(gain.sum()) / room, standard_error(gain) / room

    best = max(left, key=lambda key: share(none, left[key])[0])
    result = []
    for key, columns in made.items():
        both = left[best] if key == best else gram.held_out(np.array([*made[best], *columns]), _RIDGE)
        result.append(Dependence(*key, *share(none, left[key]), *share(left[best], both)))
    return tuple(sorted(result, key=lambda d: -d.share))
