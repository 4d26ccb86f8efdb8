"""Judgement: is one model better than another, on blocks of data that fitted neither?

Two conditions, both needed. It must be sure: the block bootstrap of the difference of the losses leaves no
doubt at 95 %, each parameter paid for by the loss that a useless one would gain (Akaike, IEEE TAC 19, 1974).
And it must matter: the residual of some channel falls by more than a few percent, or a response that noise
hides is no longer missed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rsea_ros.diagnosis.data_split import Score
from rsea_ros.signals import FloatArray

RESAMPLES = 1000
MATTERS = 0.02
"""Relative fall of a channel's residual that matters."""


@dataclass(frozen=True)
class Standing:
    """How a model stands against another: whether it is surely better, and whether that matters."""

    sure: bool
    matters: bool

    @property
    def better(self) -> bool:
        """Tell whether the model is to be preferred."""
        return self.sure and self.matters


def compare(model: Score, other: Score, extra_parameters: int = 0) -> Standing:
    """Hold a model against another. extra_parameters: how many more the model has."""
    difference = other.loss(other) - model.loss(other)
    price = 2.0 * extra_parameters / len(difference)
    means = bootstrap_means(difference - price)
    falls = [1.0 - model.ratio(n) / max(other.ratio(n), 1e-12) for n in model.sums]
    sees_more = model.missed < 0.5 * other.missed
    return Standing(
        sure=bool(np.quantile(means, 0.025) > 0.0), matters=max(falls, default=0.0) > MATTERS or sees_more
    )


def bootstrap_means(values: FloatArray, seed: int = 0) -> FloatArray:
    """Return the means of resampled blocks, shape (resamples,)."""
    rng = np.random.default_rng(seed)
    picks = rng.integers(0, len(values), (RESAMPLES, len(values)))
    means: FloatArray = values[picks].mean(axis=1)
    return means


def gain(with_it: Score, without: Score, channel: str) -> tuple[float, tuple[float, float]]:
    """Return 1 - RMS(residual with) / RMS(residual without) of a channel, and its 95 % bootstrap interval."""
    a, b = with_it.sums[channel], without.sums[channel]
    rng = np.random.default_rng(0)
    picks = rng.integers(0, len(a), (RESAMPLES, len(a)))
    resampled = 1.0 - np.sqrt(a[picks].sum(axis=1) / np.maximum(b[picks].sum(axis=1), 1e-300))
    low, high = np.quantile(resampled, [0.025, 0.975])
    return 1.0 - float(np.sqrt(a.sum() / max(b.sum(), 1e-300))), (float(low), float(high))
