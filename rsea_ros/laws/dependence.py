"""What the missing torque depends on: laws without a form, each over other variables, judged held out.

A spline over each variable (or terms of its past) is fitted beside all that the rig's own values can do;
its share is what it takes of the power that is left above the noise. Beside the chosen law each is fitted
again: what still takes much more than its standard error belongs to it, else it is the law's variable and
nothing else.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rsea_ros.laws.candidates import Candidate
from rsea_ros.laws.gram import SELECTION, Gram
from rsea_ros.laws.selection import standard_error
from rsea_ros.laws.terms import Place

_RIDGE = 1e-4
"""Of each part's power: a spline of many parts must not fit the noise."""


@dataclass(frozen=True)
class Dependence:
    """How much of what is left is a function of something. share: of the power above the noise, held out.

    se: its standard error. beside: what it takes of the power that the chosen law leaves, with its error.
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
        if c.term is not None and (
            (c.place, c.regressor) not in made or c.term.memory or c.term.shape == "cycles_per_revolution"
        ):
            made.setdefault((c.place, c.regressor), []).append(first + k)
    return made


def dependences(
    gram: Gram, candidates: Sequence[Candidate], given: Sequence[int] = ()
) -> tuple[Dependence, ...]:
    """Return how much of what is left depends on what, most first. given: columns of a law that acts."""
    made = families(candidates, len(gram.prior))
    none = gram.held_out(np.array([], np.int64))
    law = gram.held_out(np.array([*given], np.int64)) if given else none
    weight, near = gram.weights(none, SELECTION), gram.weights(law, SELECTION)
    result = []
    for key, columns in made.items():
        alone = (none - gram.held_out(np.array(columns), _RIDGE))[SELECTION] @ weight
        more = [k for k in columns if k not in given]
        beside = (law - gram.held_out(np.array([*given, *more]), _RIDGE))[SELECTION] @ near
        left = float((law[SELECTION] @ near).sum())
        room = max(float(((none - gram.count)[SELECTION] @ weight).sum()), 1e-9)
        result.append(
            Dependence(*key, float(alone.sum()) / room, standard_error(alone) / room,
                       float(beside.sum()) / left, standard_error(beside) / left)
        )  # fmt: skip
    return tuple(sorted(result, key=lambda d: -d.share))
