"""Recursive estimates, their scatter, and sums that notice a change.

F <- l F + A / phi,   r <- l r + c / phi,   change = r / (F + F_0)

of each parameter alone, the others at the model's values: together, calibrations and stiffness would follow
the smallest misfit. l forgets only as much as the look informs: a parameter without excitation keeps
its estimate (held). F_0 is a weak prior.
Source: Cao, Schwartz, Automatica 36, 2000 (forgetting where there is excitation).

A parameter that is within its doubt, |change| <= inner, is right; one beyond outer is to be alarmed. By Wald,
for each parameter and each sign, a look adds

    s = ((outer - inner) c - (outer^2 - inner^2) A / 2) / phi,    g = max(0, g + s)

and E exp(s) <= 1 for every change up to inner. Hence (Lorden 1971) the mean number of looks to a false alarm
is at least exp(h): with m such sums and looks T apart false alarms come at most every exp(h) T / m. A look
without motion has c = A = 0 and adds nothing. phi is the variance of the scores over that of white
innovations. A single look adds at most a share of h: a knock or an outlier is no change.
Sources: Page, Biometrika 41, 1954; Lorden, Annals of Mathematical Statistics 42, 1971, theorem 2.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rsea_ros.health.hypotheses import ChangeHypothesis, LookEvidence
from rsea_ros.records.record import FloatArray
from rsea_ros.records.statistics import Z95

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
    return np.asarray(np.log(np.maximum(mean, 1e-12)))


HOUR = 3600.0
SHARE = 0.34
"""Of the threshold that one look can add: three looks must agree."""
SUSPECT = 0.25
"""Of the threshold, from which a sum is a suspicion."""


def threshold(rate: float, sums: int, every: float) -> float:
    """Return h for a rate of false alarms an hour of a joint. sums: how many. every: s between looks."""
    return math.log(max(sums, 1) * HOUR / (rate * every))


class Cusum:
    """The sums of changes, both signs. inner, outer: shape (p,), in the unit of each. h: threshold."""

    def __init__(self, inner: FloatArray, outer: FloatArray, h: float) -> None:
        self.h = h
        self._linear, self._square = outer - inner, 0.5 * (outer**2 - inner**2)
        self.sums = np.zeros((2, len(self._linear)))
        self.looks = np.zeros((2, len(self._linear)), dtype=np.int64)

    def take(self, score: FloatArray, information: FloatArray, phi: FloatArray) -> bool:
        """Process a look: scores, informations and dispersions of the changes, (p,); report an alarm."""
        gains = np.array([self._linear * sign * score - self._square * information for sign in (1.0, -1.0)])
        self.sums = np.maximum(0.0, self.sums + np.minimum(gains / phi, SHARE * self.h))
        self.looks = np.where(self.sums > 0.0, self.looks + 1, 0)
        return self.alarm

    @property
    def alarm(self) -> bool:
        """Whether a sum has reached the threshold."""
        return bool((self.sums >= self.h).any())

    @property
    def suspects(self) -> bool:
        """Whether a sum has grown so that more should be looked at."""
        return bool((self.sums > SUSPECT * self.h).any())

    @property
    def since(self) -> int:
        """Number of looks for which the largest sum has grown."""
        return int(self.looks.flat[int(np.argmax(self.sums))])
