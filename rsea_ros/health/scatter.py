"""How innovations and scores scatter when all is right, from the first looks: no model is quite right."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rsea_ros.health.bank import CHANNELS, LookEvidence
from rsea_ros.records.record import FloatArray

SCALES = 0.3, 3.0
"""Standard deviations that the innovations of a right model may have beside those that the rig promises."""
LEAST = 0.15
"""Standard deviation, at least, of the logarithm of a look's mean square: movements differ."""


@dataclass(frozen=True)
class Scatter:
    """scale: standard deviation of the innovations by channel, (3,). phi: dispersion of the scores, (p,).

    level, spread: mean and standard deviation of the logarithm of a look's mean square by channel, (3,).
    """

    scale: FloatArray
    phi: FloatArray
    level: FloatArray
    spread: FloatArray

    def excess(self, evidence: LookEvidence) -> FloatArray:
        """Return by how many of its standard deviations each channel of a look is louder than usual, (3,)."""
        return (_loudness(evidence) - self.level) / self.spread


def scatter_of(looks: Sequence[LookEvidence]) -> Scatter:
    """Return the scatter of some looks; a change that lasts through them is not taken for scatter."""
    squares, counts = (np.sum([getattr(e, n) for e in looks], axis=0) for n in ("squares", "counts"))
    scale = np.clip(np.sqrt(squares / np.maximum(counts, 1.0)), *SCALES)
    scores, informations = zip(*(e.scale_sums(scale) for e in looks), strict=True)
    c, a = np.array(scores), np.array([np.diag(i) for i in informations])
    mean = c.sum(axis=0) / np.maximum(a.sum(axis=0), 1e-300)
    squared = (c - a * mean) ** 2 / np.maximum(a, 1e-300)
    loud = np.array([_loudness(e) for e in looks])
    return Scatter(
        scale=scale,
        phi=np.maximum(1.0, squared.sum(axis=0) / (len(looks) - 1)),
        level=loud.mean(axis=0),
        spread=np.maximum(LEAST, loud.std(axis=0, ddof=1)),
    )


def _loudness(evidence: LookEvidence) -> FloatArray:
    """Return the logarithm of the mean square by channel; zero for a missing one."""
    present = evidence.counts > 0.0
    mean = np.where(present, evidence.squares, 1.0) / np.where(present, evidence.counts, 1.0)
    assert len(mean) == len(CHANNELS)
    loudness: FloatArray = np.log(np.maximum(mean, 1e-12))
    return loudness
