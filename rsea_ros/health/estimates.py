"""Recursive estimates of all parameters together: forgetting where a look tells something, a hold where not.

    F <- D F D + A / phi,   r <- D r + c / phi,   change = (F + F_0)^-1 r

F_0 is a weak prior, so what looks alike to the data gets a wide interval. D forgets a parameter only by as
much as the look tells of it: what is not excited keeps what was known, and the look is said to hold it.
Source: Cao, Schwartz, Automatica 36, 2000 (directional forgetting).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rsea_ros.health.hypotheses import SURE, Hypothesis
from rsea_ros.signals import FloatArray

MEMORY = 60.0
"""Looks that an estimate remembers."""
WEAK = 3.0
"""Standard deviation of the prior of a change, in steps of the sensitivities or smallest changes to alarm."""


@dataclass(frozen=True)
class Estimate:
    """Value of a parameter with its 95 % interval, in its unit, and whether the last look held it."""

    name: str
    unit: str
    value: float
    ci95: tuple[float, float]
    held: bool


class Estimates:
    """The estimates of all hypotheses of a bank."""

    def __init__(self, hypotheses: Sequence[Hypothesis]) -> None:
        self._hypotheses = tuple(hypotheses)
        p = len(self._hypotheses)
        self._information, self._score = np.zeros((p, p)), np.zeros(p)
        self._prior = np.diag([1.0 / (WEAK * max(h.step, h.outer)) ** 2 for h in self._hypotheses])
        self._held = np.ones(p, dtype=bool)

    def take(self, score: FloatArray, information: FloatArray, phi: FloatArray) -> None:
        """Take in a look: c (p,), A (p, p), dispersion (p,)."""
        own = np.diag(information) / phi
        self._held = own < np.diag(self._prior)
        told = own / np.maximum(np.diag(self._information) / MEMORY, np.maximum(own, 1e-300))
        forget = np.sqrt(1.0 - told / MEMORY)
        root = np.sqrt(phi)
        self._information = forget[:, None] * self._information * forget + information / np.outer(root, root)
        self._score = forget * self._score + score / phi

    def hold(self) -> None:
        """Take in a look that nothing moved."""
        self._held[:] = True

    def estimates(self) -> list[Estimate]:
        """Return value and interval of each parameter."""
        covariance = np.linalg.inv(self._information + self._prior)
        common = np.array([h.common for h in self._hypotheses])
        change, half = covariance @ self._score, SURE * np.sqrt(np.diag(covariance) + common**2)
        return [
            Estimate(h.name, h.unit, h.value + c, (h.value + c - d, h.value + c + d), held)
            for h, c, d, held in zip(
                self._hypotheses, change.tolist(), half.tolist(), self._held.tolist(), strict=True
            )
        ]
