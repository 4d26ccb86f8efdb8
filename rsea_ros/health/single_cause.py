"""The single cause that explains some looks best, with size and probability: a fit of each, not its slope.

Each hypothesis is fitted by Gauss-Newton with the observer itself, so play or a long delay, which no slope at
zero describes, are compared by their real effect. The cost of an innovation w is that of Student's t with
four degrees of freedom, 2.5 log(1 + w^2 / 4): outliers do not decide. The gain is the drop of its sum, over
the ratio of the best cause's cost to that of white innovations. Each hypothesis is fitted to the clearest
look first, the one with the greatest cost, and only those that explain it best are fitted to all looks.
Source: Lange, Little, Taylor, Journal of the American Statistical Association 84, 1989 (t instead of Gauss).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from rsea_ros.health.hypotheses import ChangeHypothesis, whiten
from rsea_ros.health.look import Look
from rsea_ros.model.observer.log import BatchObserver
from rsea_ros.model.observer.signal_noise import Noise
from rsea_ros.model.rig import Rig
from rsea_ros.records.normal import Z95
from rsea_ros.records.record import FloatArray

FREEDOM = 4.0
WHITE = 2.5 * 0.19366
"""Mean cost of an innovation of variance 1: 2.5 E log(1 + z^2 / 4), z normal."""
ROUNDS, SHORTEST = 8, 0.02
"""Steps of Gauss-Newton; a step so small beside its own sigma, or beside `least`, is the last."""
HOPELESS, TRIES = 200.0, 2
"""Cost by which a fit may be worse than the best so far after so many steps, and still go on."""
FINALISTS = 4
"""Causes that are fitted to all looks."""
STARTS = (-3.0, 3.0, 12.0)
"""Changes from which a fit may begin, in `least`, beside that of the sensitivities."""


@dataclass(frozen=True)
class ChangeCause:
    """A fitted cause. change, ci95: in the parameter's unit. probability: among the causes that were fitted.

    explained: part of the excess of the innovations that it explains. cost: of the fit (see Fitter).
    """

    hypothesis: ChangeHypothesis
    change: float
    ci95: tuple[float, float]
    probability: float
    explained: float
    cost: float


_Point = tuple[float, FloatArray, float]
"""A change, its innovations and their cost."""


@dataclass(frozen=True)
class _Fit:
    hypothesis: ChangeHypothesis
    change: float
    cost: float
    sigma: float


class Fitter:
    """Fits over some looks. scale: standard deviation of the innovations by channel when all is right."""

    def __init__(self, rig: Rig, noise: Noise, hold: float, looks: Sequence[Look], scale: FloatArray) -> None:
        self._rig, self._noise, self._hold = rig, noise, hold
        self._looks, self._scale = looks, scale

    def causes(self, hypotheses: Sequence[ChangeHypothesis], starts: FloatArray) -> list[ChangeCause]:
        """Return the FINALISTS causes, the most probable first. starts: changes to begin with, (p,)."""
        before = self._innovations(self._rig)
        usual = WHITE * float(np.isfinite(before).sum())
        excess = float(cost(before) - usual)
        finalists = self._finalists(hypotheses, starts)
        fits = self._fits((f.hypothesis, self._at(f.hypothesis, f.change)) for f in finalists)
        phi = max(1.0, min(f.cost for f in fits) / usual)
        gains = np.array([(cost(before) - f.cost) / phi for f in fits])
        weights = np.exp(np.clip(gains - gains.max(), -700.0, 0.0))
        shares = (weights / weights.sum()).tolist()
        explained = [(excess + usual - f.cost) / max(excess, 1.0) for f in fits]
        candidates = [
            ChangeCause(f.hypothesis, f.change, _interval(f, phi), share, part, f.cost)
            for f, share, part in zip(fits, shares, explained, strict=True)
        ]
        return sorted(candidates, key=lambda cause: -cause.probability)

    def now(self) -> float:
        """Return the cost of the unchanged rig on the looks; zero without any."""
        return cost(self._innovations(self._rig)) if self._looks else 0.0

    def _finalists(self, hypotheses: Sequence[ChangeHypothesis], starts: FloatArray) -> list[_Fit]:
        """Return the fits to the clearest look that explain it best, the best first."""
        look = max(self._looks, key=lambda one: self._on(one).now())
        clearest = self._on(look)
        begun = [(h, clearest._start(h, float(start))) for h, start in zip(hypotheses, starts, strict=True)]
        fits = clearest._fits(sorted(begun, key=lambda one: one[1][2]))
        return sorted(fits, key=lambda fit: fit.cost)[:FINALISTS]

    def _on(self, look: Look) -> Fitter:
        """Return the fitter of a single look."""
        return Fitter(self._rig, self._noise, self._hold, [look], self._scale)

    def _fits(self, begun: Iterable[tuple[ChangeHypothesis, _Point]]) -> list[_Fit]:
        """Return the fits of hypotheses from the points given; a hopeless one ends early."""
        fits: list[_Fit] = []
        for hypothesis, first in begun:
            limit = min((f.cost for f in fits), default=math.inf) + HOPELESS
            fits.append(self._fit(hypothesis, first, limit))
        return fits

    def _start(self, hypothesis: ChangeHypothesis, start: float) -> _Point:
        """Return the best of some changes to begin with."""
        low, high = hypothesis.low - hypothesis.value, hypothesis.high - hypothesis.value
        starts = (start, *(k * hypothesis.least for k in STARTS))
        tried = [self._at(hypothesis, change) for change in {min(max(s, low), high) for s in starts}]
        return min(tried, key=lambda one: one[2])

    def _fit(self, hypothesis: ChangeHypothesis, first: _Point, limit: float) -> _Fit:
        """Return the best fit of one hypothesis: Gauss-Newton with the weights of the cost."""
        low, high = hypothesis.low - hypothesis.value, hypothesis.high - hypothesis.value
        change, w, size = first
        step, sigma = max(0.1 * hypothesis.least, hypothesis.grain), math.inf
        for count in range(ROUNDS):
            if count == TRIES and size > limit:
                break
            ahead = change + step if change + step <= high else change - step
            d = (self._at(hypothesis, ahead)[1] - w) / (ahead - change)
            weight = (FREEDOM + 1.0) / (FREEDOM + w * w)
            information = float(np.nansum(weight * d * d))
            if not information > 0.0:
                break
            sigma, last = 1.0 / math.sqrt(information), change
            move = -float(np.nansum(weight * d * w)) / information
            for share in (1.0, 0.5, 0.2, 0.05):
                new = self._at(hypothesis, min(max(change + share * move, low), high))
                if new[2] < size:
                    change, w, size = new
                    break
            if abs(change - last) < SHORTEST * max(sigma, SHORTEST * hypothesis.least):
                break
        return _Fit(hypothesis, change, size, max(sigma, 0.5 * hypothesis.grain / Z95))

    def _at(self, hypothesis: ChangeHypothesis, change: float) -> _Point:
        """Return a change, its innovations and their cost."""
        w = self._innovations(hypothesis.change(self._rig, change))
        return change, w, cost(w)

    def _innovations(self, rig: Rig) -> FloatArray:
        observer = BatchObserver(rig, self._noise, hold=self._hold)
        by_look = (zip(whiten(observer, look), self._scale, strict=True) for look in self._looks)
        return np.concatenate([w / s for look in by_look for w, s in look])


def cost(w: FloatArray) -> float:
    """Return the cost of innovations; those that are missing cost nothing."""
    return 0.5 * (FREEDOM + 1.0) * float(np.nansum(np.log1p(w * w / FREEDOM)))


def _interval(fit: _Fit, phi: float) -> tuple[float, float]:
    half = Z95 * fit.sigma * math.sqrt(phi)
    return fit.change - half, fit.change + half
