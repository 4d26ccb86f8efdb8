"""Sparse regression: terms in order of what they explain, without those that depend on others.

The term enters whose addition leaves the least held-out loss. Of all
paths, one a place, the best model is the one of the largest held-out likelihood; the result is the
shortest model within one standard error of it (Breiman, Friedman, Olshen, Stone, CART, 1984, section 3.4).

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
from rsea_ros.laws.gram import FOLDS, SELECTION, Gram
from rsea_ros.laws.terms import Place
from rsea_ros.records.record import FloatArray, IntArray

MOST_TERMS = 5
_RIDGE = 1e-7
_SAME = 0.05
"""Of what the best model leaves: models that differ by less in power are alike."""


@dataclass(frozen=True)
class SparseLaw:
    """A law of some columns at one place. left: squares left of each group by fits without it."""

    place: Place
    columns: tuple[int, ...]
    left: FloatArray

    def minus_log_likelihood(self, gram: Gram) -> float:
        """Return half the number of samples times the logarithm of the residual, over all channels."""
        left, count = self.left[SELECTION].sum(axis=0), gram.count[SELECTION].sum(axis=0)
        floor = np.maximum(left / np.maximum(count, 1.0), 1.0)
        return float(0.5 * np.sum(count * (np.log(floor) + left / np.maximum(count, 1.0) / floor)))


@dataclass(frozen=True)
class Folded:
    """The sums of a Gram in each fold, channels with equal weight: inside to fit, outside to test."""

    inside: tuple[tuple[FloatArray, FloatArray], ...]
    outside: tuple[tuple[FloatArray, FloatArray, float], ...]
    penalty: FloatArray

    def loss(self, which: IntArray) -> float:
        """Return the held-out loss of fits of some columns."""
        total = 0.0
        for (a, b), (held, right, rr) in zip(self.inside, self.outside, strict=True):
            normal = a[np.ix_(which, which)]
            normal = normal + np.diag(self.penalty[which] + _RIDGE * np.diag(normal) + 1e-30)
            beta = np.linalg.solve(normal, b[which])
            total += rr - 2.0 * float(beta @ right[which]) + float(beta @ held[np.ix_(which, which)] @ beta)
        return total


def fold_sums(gram: Gram, weight: FloatArray) -> Folded:
    """Return the sums of each fold. weight: of each channel."""
    products, rights, squares = gram.by_set
    sets = [k for fold in FOLDS for k in fold]
    a = {k: np.tensordot(weight, products[k], 1) for k in sets}
    b = {k: weight @ rights[k] for k in sets}
    whole_a, whole_b = np.sum([a[k] for k in sets], axis=0), np.sum([b[k] for k in sets], axis=0)
    inside = [(np.asarray(whole_a - a[k]), np.asarray(whole_b - b[k])) for k in sets]
    outside = [(a[k], b[k], float(squares[k] @ weight)) for k in sets]
    penalty = np.zeros(gram.b.shape[2])
    penalty[: len(gram.prior)] = gram.penalty
    return Folded(tuple(inside), tuple(outside), penalty)


def paths(
    gram: Gram, candidates: Sequence[TermCandidate], given: Sequence[int] = (), most: int = MOST_TERMS
) -> list[SparseLaw]:
    """Return the models of one, two, … terms of every place. given: columns that are part of all."""
    models = []
    for place in dict.fromkeys(c.place for c in candidates):
        models += _path(gram, candidates, place, given, most)
    return models


def _path(
    gram: Gram, candidates: Sequence[TermCandidate], place: Place, given: Sequence[int], most: int
) -> list[SparseLaw]:
    first = len(gram.prior)
    free = [first + k for k, c in enumerate(candidates) if c.term is not None and c.place == place]
    chosen: list[int] = []
    models: list[SparseLaw] = []
    left = gram.held_out(np.array([*given], np.int64))
    for _ in range(most):
        sums = fold_sums(gram, gram.weights(left, SELECTION))
        base = np.concatenate([gram.nominal, np.array([*given, *chosen], np.int64)])
        ranked = sorted(free, key=lambda k: sums.loss(np.append(base, k)))
        taken = next((k for k in ranked if _acts_right(gram, candidates, [*given, *chosen, k])), None)
        if taken is None:
            break
        chosen.append(taken)
        free = [k for k in free if not _same_form(candidates[k - first], candidates[taken - first])]
        left = gram.held_out(np.array([*given, *chosen], np.int64))
        models.append(SparseLaw(place, tuple(chosen), left))
    return models


def _same_form(a: TermCandidate, b: TermCandidate) -> bool:
    """Return whether two candidates are one term with other shapes; waves and pasts of others are others."""
    assert a.term is not None and b.term is not None
    is_many = a.term.shape == "cycles_per_revolution" or a.term.memory in ("lag", "delay", "ring")
    return a.term.name == b.term.name and (a.shape == b.shape or not is_many)


def _acts_right(gram: Gram, candidates: Sequence[TermCandidate], columns: Sequence[int]) -> bool:
    """Return whether all terms that can only dissipate energy do so."""
    first = len(gram.prior)
    beta = gram.fit(np.array(columns, np.int64), SELECTION)[first:]
    terms = [candidates[k - first].term for k in columns]
    return all(b > 0.0 for b, t in zip(beta, terms, strict=True) if t is not None and t.is_drag)


def simplest(models: Sequence[SparseLaw], gram: Gram) -> SparseLaw:
    """Return the shortest model within one standard error of the one with the largest likelihood."""
    best = min(models, key=lambda m: m.minus_log_likelihood(gram))
    weight = gram.weights(best.left, SELECTION)

    def is_near(model: SparseLaw) -> bool:
        more = (model.left - best.left)[SELECTION] @ weight
        return bool(
            more.sum() <= max(standard_error(more), _SAME * float((best.left[SELECTION] @ weight).sum()))
        )

    near = [m for m in models if is_near(m)]
    return min(near, key=lambda m: (len(m.columns), m.minus_log_likelihood(gram)))


def standard_error(values: FloatArray) -> float:
    """Return the standard error of the sum of values of groups."""
    return float(np.std(values, ddof=1) * np.sqrt(len(values)))


_PART_RIDGE = 1e-4
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
        alone = (none - gram.held_out(np.array(columns), _PART_RIDGE))[SELECTION] @ weight
        more = [k for k in columns if k not in given]
        beside = (law - gram.held_out(np.array([*given, *more]), _PART_RIDGE))[SELECTION] @ near
        power = float((law[SELECTION] @ near).sum())
        room = max(float(((none - gram.count)[SELECTION] @ weight).sum()), 1e-9)
        result.append(
            Dependence(*key, float(alone.sum()) / room, standard_error(alone) / room,
                       float(beside.sum()) / power, standard_error(beside) / power)
        )  # fmt: skip
    return tuple(sorted(result, key=lambda d: -d.share))
