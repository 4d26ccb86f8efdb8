"""Recursive estimates of each parameter: forgetting after an informative look, a hold otherwise.

    F <- l F + A / phi,   r <- l r + c / phi,   change = r / (F + F_0)

of each parameter alone, the others at the model's values: together, calibrations and stiffness would follow
the smallest misfit. l forgets only as much as the look informs: a parameter without excitation keeps
its estimate (held). F_0 is a weak prior.
Source: Cao, Schwartz, Automatica 36, 2000 (forgetting where there is excitation).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rsea_ros.health.hypotheses import ChangeHypothesis
from rsea_ros.records.normal import Z95
from rsea_ros.records.record import FloatArray

MEMORY = 60.0
"""Looks that an estimate remembers."""
WEAK = 3.0
"""Standard deviation of the prior of a change, in steps of the sensitivities or smallest changes to alarm."""


@dataclass(frozen=True)
class ChangeEstimate:
    """Value of a parameter with its 95 % interval, in its unit, and whether the last look held it."""

    name: str
    unit: str
    value: float
    ci95: tuple[float, float]
    held: bool


class Estimates:
    """The estimates of all hypotheses of a bank."""

    def __init__(self, hypotheses: Sequence[ChangeHypothesis]) -> None:
        self._hypotheses = tuple(hypotheses)
        p = len(self._hypotheses)
        self._information, self._score = np.zeros(p), np.zeros(p)
        self._prior = np.array([1.0 / (WEAK * max(h.step, h.outer)) ** 2 for h in self._hypotheses])
        self._held = np.ones(p, dtype=bool)

    def take(self, score: FloatArray, information: FloatArray, phi: FloatArray) -> None:
        """Process a look: c (p,), A (p, p), dispersion (p,)."""
        single = np.diag(information) / phi
        self._held = single < self._prior
        learnt = single / np.maximum(self._information / MEMORY, np.maximum(single, 1e-300))
        forget = 1.0 - learnt / MEMORY
        self._information = forget * self._information + single
        self._score = forget * self._score + score / phi

    def hold(self) -> None:
        """Process a look without motion."""
        self._held[:] = True

    def estimates(self) -> list[ChangeEstimate]:
        """Return value and interval of each parameter."""
        variance = 1.0 / (self._information + self._prior)
        common = np.array([h.common for h in self._hypotheses])
        change, half = variance * self._score, Z95 * np.sqrt(variance + common**2)
        return [
            ChangeEstimate(h.name, h.unit, h.value + c, (h.value + c - d, h.value + c + d), held)
            for h, c, d, held in zip(
                self._hypotheses, change.tolist(), half.tolist(), self._held.tolist(), strict=True
            )
        ]
