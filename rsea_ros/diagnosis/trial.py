"""A trial: one effect tried beside a model, and why it is no cause."""

from __future__ import annotations

from dataclasses import dataclass

from rsea_ros.diagnosis.candidate import Candidate
from rsea_ros.diagnosis.result import Reason
from rsea_ros.identification.problem import Problem
from rsea_ros.signals import FloatArray


@dataclass(frozen=True)
class Trial:
    """An effect tried beside a model. problem, theta: with it, as far as its fit went.

    is_full: fitted to all training blocks, not only to short pieces. rival: the effect that was preferred.
    """

    name: str
    beside: Candidate
    problem: Problem
    theta: FloatArray
    is_full: bool
    reason: Reason
    rival: str = ""


def trial_of(model: Candidate, name: str, beside: Candidate, reason: Reason, rival: str = "") -> Trial:
    """Return the trial of an effect that was fitted to all training blocks."""
    return Trial(name, beside, model.problem, model.solution.theta, True, reason, rival)
