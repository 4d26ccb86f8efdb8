"""What is usual for a joint, from its first looks: the model tuned to them, and how its innovations scatter.

The computation examines one look at a time, so that learning takes as little of a core as watching does.
"""

from __future__ import annotations

import math
from collections.abc import Generator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rsea_ros.health.bank import Bank, LookEvidence
from rsea_ros.health.hypotheses import FACTOR, GAINS, ChangeHypothesis, hypotheses_of, nuisances_of
from rsea_ros.health.look import FEWEST, Look
from rsea_ros.health.settings import WatchSettings
from rsea_ros.health.tuning import examine, tune
from rsea_ros.model.observer.log import STATE
from rsea_ros.model.observer.signal_noise import Noise
from rsea_ros.model.rig import Rig

USUAL = 1e-3
"""s between measurements with which a look has too few."""


@dataclass(frozen=True)
class Learned:
    """The tuned rig, its hypotheses, and the first looks with their evidence.

    models: values of the last model by name.
    """

    rig: Rig
    hypotheses: tuple[ChangeHypothesis, ...]
    models: dict[str, float]
    looks: Sequence[Look]
    evidence: Sequence[LookEvidence]


class Learning:
    """Pass looks to `take` until it is no longer `collecting`, and the time to `advance`."""

    def __init__(self, rig: Rig, noise: Noise, settings: WatchSettings) -> None:
        self._settings = settings
        self._looks: list[Look] = []
        self._steps = learn(rig, noise, self._looks, settings.hold)
        self._examined = -math.inf

    @property
    def collecting(self) -> bool:
        """Whether it needs more looks."""
        return len(self._looks) < self._settings.learn

    def take(self, look: Look) -> None:
        """Collect a look with motion, unless there are enough."""
        if self.collecting:
            self._looks.append(look)

    def advance(self, now: float) -> Learned | None:
        """Examine the next look, at most one every `every` seconds; return the result after the last.

        now: s.
        """
        if self.collecting or 0.0 <= now - self._examined < self._settings.every:
            return None
        self._examined = now
        try:
            next(self._steps)
        except StopIteration as end:
            result: Learned = end.value
            return result
        return None


def learn(rig: Rig, noise: Noise, looks: Sequence[Look], hold: float) -> Generator[None, None, Learned]:
    """Tune a rig to looks and return their evidence for it; yield after each examined look."""
    t = looks[-1].t[looks[-1].kind == STATE]
    period = float(np.median(np.diff(t))) if len(t) > FEWEST else USUAL
    models = hypotheses_of(rig, period)
    single = (*(h for h in models if h.name not in (FACTOR, *GAINS)), *nuisances_of(rig))
    tuned, now = yield from tune(rig, noise, single, looks, hold)
    known = {h.name: h for h in now}
    hypotheses = tuple(
        replace(h, value=known[h.name].value, common=known[h.name].common) if h.name in known else h
        for h in models
    )
    evidence = yield from examine(Bank(tuned, noise, hypotheses, hold), looks)
    return Learned(tuned, hypotheses, {h.name: h.value for h in models}, looks, evidence)
