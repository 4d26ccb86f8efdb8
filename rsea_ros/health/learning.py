"""What is usual for this machine, learnt at the start, and the thresholds from it.

The computation examines one look at a time, so that learning takes as little of a core as watching does.

d = argmin d' (A + F_0) d / 2 - c' d,   F_0 = diag(1 / doubt^2),   |d| <= Z95 doubt

for all parameters together. A deviation beyond the doubt stays a change and alarms.
"""

from __future__ import annotations

import math
from collections.abc import Generator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import lsq_linear

from rsea_ros.health.health_finding import WatchSettings
from rsea_ros.health.hypotheses import (
    FACTOR,
    GAINS,
    Bank,
    ChangeHypothesis,
    LookEvidence,
    hypotheses_of,
    nuisances_of,
)
from rsea_ros.health.look import FEWEST, Look
from rsea_ros.health.recursive_estimates import scatter_of
from rsea_ros.model.observer.log import STATE
from rsea_ros.model.observer.signal_noise import Noise
from rsea_ros.model.rig import Rig
from rsea_ros.records.normal import Z95
from rsea_ros.records.record import FloatArray

_CERTAIN = 1e-6
"""Doubt of what has none, in its smallest change: such a parameter does not move."""


ROUNDS = 2
"""Solutions of the linear problem, each about the one before."""


def tune(
    rig: Rig, noise: Noise, hypotheses: Sequence[ChangeHypothesis], looks: Sequence[Look], hold: float
) -> Generator[None, None, tuple[Rig, tuple[ChangeHypothesis, ...]]]:
    """Return rig and hypotheses with the values that the looks have, within the doubts; yield as examine."""
    total, now, first = np.zeros(len(hypotheses)), tuple(hypotheses), rig
    for _ in range(ROUNDS):
        evidence = yield from examine(Bank(rig, noise, now, hold), looks)
        total, sigma = _change(evidence, hypotheses, total)
        changes = list(zip(hypotheses, total.tolist(), strict=True))
        now = tuple(
            replace(h, value=min(max(h.value + by, h.low), h.high), common=s)
            for (h, by), s in zip(changes, sigma.tolist(), strict=True)
        )
        rig = first
        for hypothesis, by in changes:
            rig = hypothesis.change(rig, by)
    return rig, now


def examine(bank: Bank, looks: Sequence[Look]) -> Generator[None, None, list[LookEvidence]]:
    """Return the evidence of the looks; yield after each."""
    evidence = []
    for look in looks:
        evidence.append(bank.evidence(look))
        yield
    return evidence


def _change(
    evidence: Sequence[LookEvidence], hypotheses: Sequence[ChangeHypothesis], before: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the change of each parameter in all and its sigma, (p,). before: as the looks were judged."""
    scatter = scatter_of(evidence)
    both = [e.scale_sums(scatter.scale) for e in evidence]
    score, information = np.sum([c for c, _ in both], axis=0), np.sum([a for _, a in both], axis=0)
    doubt = np.array([max(h.doubt, _CERTAIN * h.least) for h in hypotheses])
    information, score = information * np.outer(doubt, doubt), score * doubt
    root = np.linalg.cholesky(information + np.eye(len(doubt)))
    wanted = np.linalg.solve(root, score + information @ (before / doubt))
    sigma = doubt * np.sqrt(np.diag(np.linalg.inv(root @ root.T)))
    return doubt * lsq_linear(root.T, wanted, bounds=(-Z95, Z95)).x, sigma


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
