"""A bank of observers, the model's and one for each hypothesis: how the innovations of a look depend on each.

    w(theta) = innovation over its standard deviation, white and of variance 1 for the right theta
    D_i = (w(theta + step_i) - w(theta)) / step_i,   A = D'D,   c = -D'w

c is the score and A Fisher's information of the changes: were the change d, log p(d)/p(0) = d c - d^2 A / 2.
Source: Basseville, Nikiforov, Detection of Abrupt Changes, 1993, section 8.2 (the local approach).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rsea_ros.health.hypotheses import ChangeHypothesis
from rsea_ros.health.look import Look
from rsea_ros.model.observer.batch import BatchObserver
from rsea_ros.model.observer.log import FT, STATE
from rsea_ros.model.observer.signal_noise import Noise
from rsea_ros.model.rig import Rig
from rsea_ros.records.record import FloatArray

CHANNELS = ("position", "ft", "motor_torque")
HEAVY = 8.0
"""Standard deviations beyond which an innovation counts for less: an outlier counts no more than the rest."""


class LookEvidence(NamedTuple):
    """Of one look by channel: c (3, p), A (3, p, p), sum of squares and number of innovations, shape (3,)."""

    score: FloatArray
    information: FloatArray
    squares: FloatArray
    counts: FloatArray

    def scale_sums(self, scale: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return c (p,) and A (p, p) of all channels. scale: standard deviation of the innovations, (3,)."""
        weights = 1.0 / scale**2
        return weights @ self.score, np.tensordot(weights, self.information, 1)


class Bank:
    """The observers of a rig. hold: how long a command stays in force, s."""

    def __init__(self, rig: Rig, noise: Noise, hypotheses: Sequence[ChangeHypothesis], hold: float) -> None:
        self._steps = np.array([[h.step] for h in hypotheses])
        rigs = (rig, *(h.change(rig, h.step) for h in hypotheses))
        self._observers = [BatchObserver(each, noise, hold=hold) for each in rigs]

    def evidence(self, look: Look) -> LookEvidence:
        """Return the evidence of a look."""
        by_channel = [whiten(observer, look) for observer in self._observers]
        p, n = len(self._steps), len(CHANNELS)
        evidence = LookEvidence(np.zeros((n, p)), np.zeros((n, p, p)), np.zeros(n), np.zeros(n))
        for channel in range(n):
            w = np.array([each[channel] for each in by_channel])
            w = w[:, np.isfinite(w).all(axis=0)]
            weight = np.minimum(1.0, HEAVY / np.maximum(np.abs(w[0]), 1e-9))
            d = (w[1:] - w[0]) / self._steps
            evidence.score[channel] = -(d * weight) @ w[0]
            evidence.information[channel] = (d * weight) @ d.T
            evidence.squares[channel], evidence.counts[channel] = float(w[0] @ (weight * w[0])), w.shape[1]
        return evidence


def whiten(observer: BatchObserver, look: Look) -> tuple[FloatArray, ...]:
    """Return the innovations of a look by channel over their standard deviations; nan where missing."""
    w = observer.innovations(look.t, look.kind, look.values)
    state, ft = look.counts & (look.kind == STATE), look.counts & (look.kind == FT)
    return w[state, 0], w[ft, 0], w[state, 1]
