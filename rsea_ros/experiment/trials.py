"""Shapes tried at several lengths, each rated by the share of the cases that it is expected to decide."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rsea_ros.experiment.proposal import DesignRequest
from rsea_ros.experiment.run_shape import FEWEST, Shape
from rsea_ros.experiment.separation import chances_decided, decided_share, likely_separations
from rsea_ros.experiment.shape_rater import ShapeRater
from rsea_ros.records.record import BoolArray, FloatArray

_TRIED: tuple[Shape, ...] = (
    Shape("multisine", 1.0, low=0.5, high=8.0),
    Shape("multisine", 1.0, low=0.5, high=40.0, tilt=0.5),
    Shape("multisine", 1.0, low=2.0, high=25.0),
    Shape("multisine", 1.0, low=10.0, high=100.0),
    Shape("multisine", 0.5, bias=0.5, low=0.5, high=25.0),
    Shape("multisine", 0.3, low=0.5, high=40.0, tilt=0.5),
    Shape("chirp", 1.0, low=0.3, high=30.0),
    Shape("chirp", 1.0, low=2.0, high=100.0),
    Shape("steps", 1.0, hold=0.03),
    Shape("steps", 1.0, hold=0.1),
    Shape("steps", 1.0, hold=0.3),
    Shape("holds", 1.0, hold=0.15),
    Shape("steps", 0.3, bias=0.5, hold=0.2),
)
"""Where the search begins; amplitude and bias as shares of what the limits allow."""
_LEAST = 0.05
"""Share that a run must be expected to decide to be preferred to a longer one."""


@dataclass(frozen=True)
class Trial:
    """A shape of a length (s), the share that it is expected to decide, the least S of the likeliest two."""

    share: float
    length: float
    shape: Shape
    least: float

    def per_second(self, per_run: float) -> float:
        """Return the share that it decides per second; per_run: s that one more run costs."""
        return self.share / (per_run + self.length)


def shapes_for(asked: DesignRequest) -> list[Shape]:
    """Return the shapes from which the search for a run begins."""
    return [s for s in _TRIED if s.kind in asked.kinds]


def least_share(asked: DesignRequest) -> float:
    """Return the share that a run must be expected to decide to be preferred to a longer one."""
    return asked.test or _LEAST


def try_lengths(rater: ShapeRater, shapes: Sequence[Shape], apart: BoolArray, shortest: float) -> list[Trial]:
    """Return the shapes of every length from some seconds, up to one that could not be worth its seconds."""
    asked, trials = rater.asked, list[Trial]()
    doublings = math.ceil(math.log2(asked.longest / shortest))
    for seconds in np.geomspace(shortest, asked.longest, doublings + 1):
        length = float(np.rint(seconds * asked.rate) / asked.rate)
        if trials and _is_beyond(best_of(trials, asked), length, asked):
            break
        possible = [s for s in shapes if length * asked.rate >= FEWEST[s.kind]]
        trials += [trial_of(rater, s, length, apart) for s in possible]
    return trials


def _is_beyond(best: Trial, length: float, asked: DesignRequest) -> bool:
    """Return whether no run of a length (s) can decide more per second than the best trial so far."""
    is_enough = best.share >= least_share(asked)
    return is_enough and best.per_second(asked.per_run) > 1.0 / (asked.per_run + length)


def best_of(trials: Sequence[Trial], asked: DesignRequest) -> Trial:
    """Return the trial that decides most per second; where none decides enough, the one that decides most.

    Of several that decide nothing the longest, with the largest S of the likeliest two.
    """
    enough = [t for t in trials if t.share >= least_share(asked)]
    if not enough:
        return max(trials, key=lambda t: (t.share, t.length, t.least))
    return max(enough, key=lambda t: t.per_second(asked.per_run))


def trial_of(rater: ShapeRater, shape: Shape, length: float, apart: BoolArray) -> Trial:
    """Return a shape of a length (s), rated. apart: pairs that no run separates, shape (k, k)."""
    rows = likely_separations(rater.hypotheses, rater.responses(rater.within(shape, length)))
    share = share_decided(rater, chances_decided(rater.hypotheses, rows, apart))
    first, second = sorted(range(len(rows)), key=lambda k: -rater.hypotheses[k].probability)[:2]
    least = min(float(rows[first][:, second].mean()), float(rows[second][:, first].mean()))
    return Trial(share, length, shape, least)


def share_decided(rater: ShapeRater, chances: FloatArray) -> float:
    """Return the share of the cases that a run is expected to decide; in a test, of those it is for."""
    first = 1 if rater.asked.test else 0
    return decided_share(rater.hypotheses[first:], chances[first:])
