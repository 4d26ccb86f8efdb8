"""Sparse regression: terms in order of what they explain, without those that depend on others.

The term enters whose addition leaves the least held-out loss. Of all
paths, one a place, the best model is the one of the largest held-out likelihood; the result is the
shortest model within one standard error of it (Breiman, Friedman, Olshen, Stone, CART, 1984, section 3.4).

A spline over each variable (or terms of its past) is fitted beside the derivatives by the rig's values;
its share is the part that it explains of the power above the noise. Beside the chosen law each is fitted
again: one that still explains much more than its standard error belongs to the law, otherwise only the
law's variable does.

Least squares from sums of products, by group of blocks and channel: cheap fits and held-out losses.

For every group and channel the sums A = X'X, b = X'r and r'r are kept. A fit on some groups adds theirs; its
loss in another group is r'r - 2 beta'b + beta'A beta, without the data.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rsea_ros.diagnosis.data_split import TEST
from rsea_ros.identification.missing_torque import Place
from rsea_ros.laws.candidates import TermCandidate
from rsea_ros.laws.variables import GROUPS, ResidualRows
from rsea_ros.records.record import FloatArray, IntArray

_GRAM_RIDGE = 1e-6
"""Of each column's power: keeps columns apart that the data do not."""
_REWEIGHTINGS = 3
_LEAST = 1e-30
"""RMS of a column, over the noise, below which the data do not show it: it is not scaled."""
FOLDS = (0, 1, 2)
"""Sets of blocks that are held out in turn; the test blocks take part in nothing."""


@dataclass(frozen=True)
class Gram:
    """Sums of products. a: (groups, channels, n, n), b: (groups, channels, n), rr, count: (groups, channels).

    scale: by which each column was divided. nominal: how many of the columns belong to the rig, the first
    ones. prior: their priors' precisions, in their own scale.
    """

    a: FloatArray
    b: FloatArray
    rr: FloatArray
    count: FloatArray
    scale: FloatArray
    prior: FloatArray

    @cached_property
    def by_set(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The sums a, b and rr of each set of blocks, channels apart."""
        sums = (self.a, self.b, self.rr)
        a, b, rr = (np.array([v[groups_of((k,))].sum(axis=0) for k in range(4)]) for v in sums)
        return a, b, rr

    @cached_property
    def penalty(self) -> FloatArray:
        """The squared priors of the rig's columns, in the columns' scale; zero for the others."""
        penalty = np.zeros(len(self.scale))
        penalty[: len(self.prior)] = (self.prior / self.scale[: len(self.prior)]) ** 2
        return penalty

    @property
    def nominal(self) -> IntArray:
        """The rig's columns."""
        return np.arange(len(self.prior))

    def weights(self, loss: FloatArray, groups: IntArray) -> FloatArray:
        """Return by channel 1 / (residual of a model over the noise)^2, at most 1."""
        ratio = loss[groups].sum(axis=0) / np.maximum(self.count[groups].sum(axis=0), 1.0)
        return np.asarray(1.0 / np.maximum(ratio, 1.0))

    def fit(self, columns: IntArray, groups: IntArray, ridge: float = _GRAM_RIDGE) -> FloatArray:
        """Return coefficients of the rig's and some other columns, fitted to some groups.

        Each channel has the weight of its residual (maximum likelihood with unknown noise).
        """
        which = np.concatenate([self.nominal, columns])
        a = self.a[np.ix_(groups, np.arange(self.a.shape[1]), which, which)].sum(axis=0)
        b = self.b[groups].sum(axis=0)[:, which]
        rr, count = self.rr[groups].sum(axis=0), np.maximum(self.count[groups].sum(axis=0), 1.0)
        beta = np.zeros(len(which))
        for _ in range(_REWEIGHTINGS):
            squares = rr - 2.0 * b @ beta + np.einsum("i,cij,j->c", beta, a, beta)
            weight = 1.0 / np.maximum(squares / count, 1.0)
            normal = np.tensordot(weight, a, 1)
            normal = normal + np.diag(self.penalty[which] + ridge * np.diag(normal) + 1e-30)
            beta = np.linalg.solve(normal, weight @ b)
        return np.asarray(beta)

    def loss(self, columns: IntArray, beta: FloatArray) -> FloatArray:
        """Return the squares that coefficients leave, (groups, channels)."""
        which = np.concatenate([self.nominal, columns])
        a = self.a[:, :, which[:, None], which]
        return np.asarray(
            self.rr - 2.0 * self.b[:, :, which] @ beta + np.einsum("i,gcij,j->gc", beta, a, beta)
        )

    def held_out(self, columns: IntArray, ridge: float = _GRAM_RIDGE) -> FloatArray:
        """Return the squares that are left of each group by fits without its set, (groups, channels)."""
        out = np.zeros_like(self.rr)
        for fold in FOLDS:
            inside, at = groups_of([f for f in FOLDS if f != fold]), groups_of([fold])
            out[at] = self.loss(columns, self.fit(columns, inside, ridge))[at]
        return out


def groups_of(sets: Sequence[int]) -> IntArray:
    """Return the groups of some sets of blocks."""
    return np.concatenate([np.arange(s * GROUPS, (s + 1) * GROUPS) for s in sets])


SELECTION, HELD_BACK = groups_of(FOLDS), groups_of(TEST)


def gram_of(rows: ResidualRows, columns: Sequence[FloatArray]) -> Gram:
    """Return the sums of products of the rig's derivatives, some columns and the residual."""
    nominal = rows.nominal
    x = np.empty((len(rows.residual), nominal.shape[1] + len(columns)), np.float32)
    scale = np.empty(x.shape[1])
    for k in range(x.shape[1]):
        column = nominal[:, k] if k < nominal.shape[1] else columns[k - nominal.shape[1]]
        size = float(np.sqrt(np.mean(column**2)))
        scale[k] = size if size > _LEAST else 1.0
        x[:, k] = column / scale[k]
    n, groups, channels = x.shape[1], 4 * GROUPS, len(rows.channels)
    a, b = np.zeros((groups, channels, n, n)), np.zeros((groups, channels, n))
    rr, count = np.zeros((groups, channels)), np.zeros((groups, channels))
    for (g, c), at in rows.parts.items():
        part, r = x[at].astype(np.float64), rows.residual[at]
        a[g, c], b[g, c], rr[g, c], count[g, c] = part.T @ part, part.T @ r, r @ r, len(at)
    return Gram(a, b, rr, count, scale, rows.prior)


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
    a = [np.tensordot(weight, products[k], 1) for k in FOLDS]
    b = [weight @ rights[k] for k in FOLDS]
    whole_a, whole_b = np.sum(a, axis=0), np.sum(b, axis=0)
    inside = [(np.asarray(whole_a - a_k), np.asarray(whole_b - b_k)) for a_k, b_k in zip(a, b, strict=True)]
    outside = [(a[i], b[i], float(squares[k] @ weight)) for i, k in enumerate(FOLDS)]
    return Folded(tuple(inside), tuple(outside), gram.penalty)


def paths(
    gram: Gram, candidates: Sequence[TermCandidate], given: Sequence[int] = (), most: int = MOST_TERMS
) -> list[SparseLaw]:
    """Return the models of one, two, … terms of every place. given: columns that are part of all."""
    places = dict.fromkeys(c.place for c in candidates)
    return [model for place in places for model in _path(gram, candidates, place, given, most)]


def _path(
    gram: Gram, candidates: Sequence[TermCandidate], place: Place, given: Sequence[int], most: int
) -> Iterator[SparseLaw]:
    first = len(gram.prior)
    free = [first + k for k, c in enumerate(candidates) if c.term is not None and c.place == place]
    chosen: list[int] = []
    left = gram.held_out(np.array([*given], np.int64))
    for _ in range(most):
        sums = fold_sums(gram, gram.weights(left, SELECTION))
        base = np.concatenate([gram.nominal, np.array([*given, *chosen], np.int64)])
        ranked = sorted(free, key=lambda k: sums.loss(np.append(base, k)))
        taken = next((k for k in ranked if _acts_right(gram, candidates, [*given, *chosen, k])), None)
        if taken is None:
            return
        chosen.append(taken)
        free = [k for k in free if not _same_form(candidates[k - first], candidates[taken - first])]
        left = gram.held_out(np.array([*given, *chosen], np.int64))
        yield SparseLaw(place, tuple(chosen), left)


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
