"""Least squares from sums of products, by group of blocks and channel: cheap fits and held-out losses.

For every group and channel the sums A = X'X, b = X'r and r'r are kept. A fit on some groups adds theirs; its
loss in another group is r'r - 2 beta'b + beta'A beta, without the data.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rsea_ros.diagnosis.data_split import TEST
from rsea_ros.laws.columns import GROUPS, ResidualRows
from rsea_ros.records.record import FloatArray, IntArray

_RIDGE = 1e-6
"""Of each column's power: keeps columns apart that the data do not."""
_REWEIGHTINGS = 3
_LEAST = 1e-30
"""RMS of a column, over the noise, below which the data do not show it: it is not scaled."""
FOLDS = ((0,), (1,), (2,))
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
        sets = range(4)
        sums = ([v[groups_of((k,))].sum(axis=0) for k in sets] for v in (self.a, self.b, self.rr))
        a, b, rr = (np.array(v) for v in sums)
        return a, b, rr

    @cached_property
    def penalty(self) -> FloatArray:
        """The squared priors of the rig's columns, in the columns' scale."""
        return np.asarray((self.prior / self.scale[: len(self.prior)]) ** 2)

    @property
    def nominal(self) -> IntArray:
        """The rig's columns."""
        return np.arange(len(self.prior))

    def weights(self, loss: FloatArray, groups: IntArray) -> FloatArray:
        """Return by channel 1 / (residual of a model over the noise)^2, at most 1."""
        ratio = loss[groups].sum(axis=0) / np.maximum(self.count[groups].sum(axis=0), 1.0)
        return np.asarray(1.0 / np.maximum(ratio, 1.0))

    def fit(self, columns: IntArray, groups: IntArray, ridge: float = _RIDGE) -> FloatArray:
        """Return coefficients of the rig's and some other columns, fitted to some groups.

        Each channel has the weight of its residual (maximum likelihood with unknown noise).
        """
        which = np.concatenate([self.nominal, columns])
        a = self.a[np.ix_(groups, np.arange(self.a.shape[1]), which, which)].sum(axis=0)
        b = self.b[groups].sum(axis=0)[:, which]
        rr, count = self.rr[groups].sum(axis=0), np.maximum(self.count[groups].sum(axis=0), 1.0)
        beta = np.zeros(len(which))
        penalty = np.zeros(len(which))
        penalty[: len(self.prior)] = self.penalty
        for _ in range(_REWEIGHTINGS):
            squares = rr - 2.0 * b @ beta + np.einsum("i,cij,j->c", beta, a, beta)
            weight = 1.0 / np.maximum(squares / count, 1.0)
            normal = np.tensordot(weight, a, 1)
            normal = normal + np.diag(penalty + ridge * np.diag(normal) + 1e-30)
            beta = np.linalg.solve(normal, weight @ b)
        return np.asarray(beta)

    def loss(self, columns: IntArray, beta: FloatArray) -> FloatArray:
        """Return the squares that coefficients leave, (groups, channels)."""
        which = np.concatenate([self.nominal, columns])
        a = self.a[:, :, which[:, None], which]
        return np.asarray(
            self.rr - 2.0 * self.b[:, :, which] @ beta + np.einsum("i,gcij,j->gc", beta, a, beta)
        )

    def held_out(self, columns: IntArray, ridge: float = _RIDGE) -> FloatArray:
        """Return the squares that are left of each group by fits without its set, (groups, channels)."""
        out = np.zeros_like(self.rr)
        for fold in FOLDS:
            inside = groups_of([s for f in FOLDS if f != fold for s in f])
            at = groups_of(fold)
            out[at] = self.loss(columns, self.fit(columns, inside, ridge))[at]
        return out

    def squares_left(self, columns: IntArray, ridge: float = _RIDGE) -> FloatArray:
        """Return the squares left by a fit on all but the test blocks, (groups, channels)."""
        return self.loss(columns, self.fit(columns, groups_of([s for f in FOLDS for s in f]), ridge))


def groups_of(sets: Sequence[int]) -> IntArray:
    """Return the groups of some sets of blocks."""
    return np.concatenate([np.arange(s * GROUPS, (s + 1) * GROUPS) for s in sets])


SELECTION, HELD_BACK = groups_of([s for f in FOLDS for s in f]), groups_of(TEST)


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
