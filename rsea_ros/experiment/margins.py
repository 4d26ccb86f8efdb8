"""Limits held although the bench is not known: a chance constraint over draws of its values.

For each hypothesis that may be true, the largest of every limited quantity is simulated over draws from what
is known of its numbers. Its logarithm is taken as normal, with Student's factor for the number of draws; the
quantile of LEVEL must lie within the limit, and so must every draw.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student

from rsea_ros.experiment.hypothesis import Hypothesis, motion
from rsea_ros.experiment.limits import OF_COMMAND, Limits, of_command, of_response, used
from rsea_ros.model.rig import Rig
from rsea_ros.signals import FloatArray

LEVEL = 1.0 - 1e-5
"""Probability, under each hypothesis, with which each limit holds."""
DRAWS = 12
BETWEEN = 1.02
"""What a peak between two samples may have above them."""
_SMALLEST = 1e-12


@dataclass(frozen=True)
class Peaks:
    """The largest of every quantity in a run: expected at the most likely values, and at LEVEL."""

    expected: dict[str, float]
    at_level: dict[str, float]


def drawn(hypotheses: Sequence[Hypothesis], seed: int = 0) -> list[list[Rig]]:
    """Return for each hypothesis its most likely rig, then DRAWS others."""
    rng = np.random.default_rng(seed)
    return [[h.rig, *h.draws(DRAWS, rng)] for h in hypotheses]


def peaks(command: FloatArray, rate: float, rigs: Sequence[Sequence[Rig]]) -> Peaks:
    """Return the peaks of a command over rigs, by hypothesis."""
    by_command = of_command(command, rate)
    expected, at_level = dict(by_command), dict(by_command)
    for group in rigs:
        runs = [of_response(command, motion(rig, command, rate)) for rig in group]
        for name in runs[0]:
            values = BETWEEN * np.array([run[name] for run in runs])
            expected[name] = max(expected.get(name, 0.0), float(values[0]))
            at_level[name] = max(at_level.get(name, 0.0), quantile(values))
    return Peaks(expected, at_level)


def quantile(values: FloatArray) -> float:
    """Return the upper limit at LEVEL for one more value like these, which are > 0, and no less than any."""
    if not np.isfinite(values).all():
        return np.inf
    logs = np.log(np.maximum(values, _SMALLEST))
    n = len(logs)
    beyond = float(student.ppf(LEVEL, n - 1)) * np.sqrt(1.0 + 1.0 / n) * float(np.std(logs, ddof=1))
    return float(max(np.exp(np.mean(logs) + beyond), np.max(values)))


def share_used(found: Peaks, limits: Limits) -> float:
    """Return the largest share of a limit that is used at LEVEL."""
    return used(found.at_level, limits)


__all__ = ["LEVEL", "OF_COMMAND", "Peaks", "drawn", "peaks", "quantile", "share_used"]
