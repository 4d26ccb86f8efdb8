"""Dependences of the missing torque: splines, each over another variable, tested on held-out data.

A spline over each variable (or terms of its past) is fitted beside the derivatives by the rig's values;
its share is the part that it explains of the power above the noise. Beside the chosen law each is fitted
again: one that still explains much more than its standard error belongs to the law, otherwise only the
law's variable does.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rsea_ros.laws.candidates import TermCandidate
from rsea_ros.laws.gram import SELECTION, Gram
from rsea_ros.laws.sparse_regression import standard_error
from rsea_ros.laws.terms import Place

_RIDGE = 1e-4
"""Of each part's power: a spline of many parts must not fit the noise."""


@dataclass(frozen=True)
class Dependence:
    """The part of the residual that is a function of a variable.

    share: of the power above the noise, held out.
    se: its standard error. beside: its share of the power that the chosen law leaves, with its error.
    """

    place: Place
    regressor: str
    share: float
    se: float
    beside: float = 0.0
    beside_se: float = 0.0


def families(candidates: Sequence[TermCandidate], first: int) -> dict[tuple[Place, str], list[int]]:
    """Return the columns of splines over every variable, and of memories where a spline is impossible."""
    columns: dict[tuple[Place, str], list[int]] = {}
    for k, c in enumerate(candidates):
        if c.part is not None:
            columns.setdefault((c.place, c.regressor), []).append(first + k)
    for k, c in enumerate(candidates):
        if c.term is not None and (
            (c.place, c.regressor) not in columns or c.term.memory or c.term.shape == "cycles_per_revolution"
        ):
            columns.setdefault((c.place, c.regressor), []).append(first + k)
    return columns


def dependences(
    gram: Gram, candidates: Sequence[TermCandidate], given: Sequence[int] = ()
) -> tuple[Dependence, ...]:
    """Return the dependences of the residual, the largest first. given: columns of a law that acts."""
    groups = families(candidates, len(gram.prior))
    none = gram.held_out(np.array([], np.int64))
    law = gram.held_out(np.array([*given], np.int64)) if given else none
    weight, near = gram.weights(none, SELECTION), gram.weights(law, SELECTION)
    result = []
    for key, columns in groups.items():
        alone = (none - gram.held_out(np.array(columns), _RIDGE))[SELECTION] @ weight
        more = [k for k in columns if k not in given]
        beside = (law - gram.held_out(np.array([*given, *more]), _RIDGE))[SELECTION] @ near
        power = float((law[SELECTION] @ near).sum())
        room = max(float(((none - gram.count)[SELECTION] @ weight).sum()), 1e-9)
        result.append(
            Dependence(*key, float(alone.sum()) / room, standard_error(alone) / room,
                       float(beside.sum()) / power, standard_error(beside) / power)
        )  # fmt: skip
    return tuple(sorted(result, key=lambda d: -d.share))
