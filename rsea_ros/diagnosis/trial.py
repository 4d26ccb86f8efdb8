"""A trial: one effect beside a model in one round, and what became of it."""

from __future__ import annotations

from dataclasses import dataclass

from rsea_ros.diagnosis.candidate import Model
from rsea_ros.identification.problem import Problem
from rsea_ros.signals import FloatArray


@dataclass(frozen=True)
class Trial:
    """An effect tried beside a model. problem, theta: with it, as far as its fit went.

    is_full: fitted to everything that may be fitted to, not only to short pieces.
    """

    name: str
    beside: Model
    problem: Problem
    theta: FloatArray
    is_full: bool
    why: str


def trial_of(model: Model, name: str, beside: Model, why: str) -> Trial:
    """Return the trial of an effect that was fitted to everything."""
    return Trial(name, beside, model.solution.problem, model.solution.theta, True, why)
