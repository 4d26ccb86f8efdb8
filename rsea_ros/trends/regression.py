"""Weighted least squares with priors, and the gain of one more term at any day."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from rsea_ros.records.record import FloatArray

_LARGEST = 1e10
"""Entry of an inverse of scaled normal equations from which columns count as dependent."""
Kind = Literal["step", "ramp"]
"""A step of the level, or a change of the slope, from a day on."""


@dataclass(frozen=True)
class Regression:
    """y = X b + noise of variance 1/w, with a normal prior of mean 0 on some of b.

    x: shape (n, p). y, w: shape (n,). precision: of the prior, shape (p,), 0 for none.
    """

    x: FloatArray
    y: FloatArray
    w: FloatArray
    precision: FloatArray

    @cached_property
    def covariance(self) -> FloatArray:
        """Return that of b, shape (p, p)."""
        scale = 1.0 / np.sqrt(
            np.maximum(np.sum(self.w[:, None] * self.x**2, axis=0) + self.precision, 1e-300)
        )
        normal = (self.x * scale).T @ (self.w[:, None] * self.x * scale) + np.diag(self.precision * scale**2)
        inverse: FloatArray = _inverse(normal) * np.outer(scale, scale)
        return inverse

    @cached_property
    def coefficients(self) -> FloatArray:
        """Return b, shape (p,)."""
        b: FloatArray = self.covariance @ (self.x.T @ (self.w * self.y))
        return b

    @property
    def loss(self) -> float:
        """Return the weighted sum of squares of the residual, the prior's part included."""
        return float(np.sum(self.w * self.y**2) - self.coefficients @ (self.x.T @ (self.w * self.y)))

    def with_columns(self, columns: FloatArray) -> Regression:
        """Return the regression with further columns, shape (n, k), without a prior."""
        more = np.concatenate([self.precision, np.zeros(columns.shape[1])])
        return Regression(np.column_stack([self.x, columns]), self.y, self.w, more)


def _inverse(normal: FloatArray) -> FloatArray:
    """Return the inverse of scaled normal equations, the least one where columns depend on each other."""
    try:
        inverse = np.asarray(np.linalg.inv(normal), float)
    except np.linalg.LinAlgError:
        inverse = np.full_like(normal, np.inf)
    sure = np.max(np.abs(inverse)) < _LARGEST
    return inverse if sure else np.asarray(np.linalg.pinv(normal, hermitian=True), float)


def term(kind: Kind, t: FloatArray, at: float) -> FloatArray:
    """Return the column of a term that begins at a time: 0 before, then 1, or the time since."""
    return (t >= at).astype(float) if kind == "step" else np.maximum(t - at, 0.0)


def scan(base: Regression, t: FloatArray, kind: Kind) -> FloatArray:
    """Return the z score of a term that begins at each day, beside those of `base`, shape (n,); t rises.

    Its square is the gain in twice the log likelihood. O(n): sums from each day to the last.
    """

    def after(values: FloatArray) -> FloatArray:
        total: FloatArray = np.cumsum(values[::-1], axis=0)[::-1]
        return total

    covariance, w = base.covariance, base.w
    wr, wx = w * (base.y - base.x @ base.coefficients), w[:, None] * base.x
    cross, mixed, square = after(wr), after(wx), after(w)
    if kind == "ramp":
        square = after(w * t**2) - 2.0 * t * after(w * t) + t**2 * square
        cross = after(wr * t) - t * cross
        mixed = after(wx * t[:, None]) - t[:, None] * mixed
    left = square - np.einsum("ki,ij,kj->k", mixed, covariance, mixed)
    sure = left > 1e-9 * np.max(square)
    z: FloatArray = np.where(sure, cross / np.sqrt(np.where(sure, left, 1.0)), 0.0)
    return z
