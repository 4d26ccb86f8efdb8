"""The model tuned to the first looks within its doubts: an identification is right within its intervals only.

    d = argmin d' (A + F_0) d / 2 - c' d,   F_0 = diag(1 / doubt^2),   |d| <= Z95 doubt

for all parameters together. A deviation beyond the doubt stays a change and alarms.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import lsq_linear

from rsea_ros.health.bank import Bank, LookEvidence
from rsea_ros.health.hypotheses import ChangeHypothesis
from rsea_ros.health.look import Look
from rsea_ros.health.scatter import scatter_of
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
