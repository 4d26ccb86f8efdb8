"""Choice: which of the models that were fitted beside the present one to accept, and which do as well."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rsea_ros.diagnosis.fitting import AT_FLOOR, Model
from rsea_ros.diagnosis.judge import compare
from rsea_ros.diagnosis.split import Score
from rsea_ros.identification.solver import Solution
from rsea_ros.identification.unknowns import Unknown

ENOUGH = 0.1
"""Relative fall of a channel's residual that makes an effect a cause where the floor is not reached."""


def is_progress(model: Model, present: Model) -> bool:
    """Tell whether a model is surely better, and by enough: a tenth of a channel's residual, or all of it."""
    if not compare(model.choose, present.choose, model.parameters - present.parameters).better:
        return False
    fall = max(1.0 - model.choose.ratio(n) / max(present.choose.ratio(n), 1e-12) for n in model.choose.sums)
    return fall > ENOUGH or all(model.choose.ratio(n) < AT_FLOOR for n in model.choose.sums)


def choose(models: Sequence[Model], present: Score) -> tuple[Model | None, tuple[Model, ...]]:
    """Return the model to accept and those that do as well with no more parameters.

    Of all that are not surely and materially worse than the best, the simplest; of equals, the one that
    needs the least of what is known beforehand.
    """
    if not models:
        return None, ()
    best = min(models, key=lambda m: float(m.choose.loss(present).sum()))
    contenders = [m for m in models if m is best or not compare(best.choose, m.choose).better]
    simplest = min(contenders, key=lambda m: (m.parameters, prior_cost(m.solution) + loss_excess(m, best)))
    rivals = tuple(m for m in contenders if m is not simplest and m.parameters <= simplest.parameters)
    return simplest, rivals


def prior_cost(solution: Solution) -> float:
    """Return what the fit paid for leaving the values that were known beforehand."""
    unknowns: Sequence[Unknown] = solution.problem.unknowns
    return float(
        sum(
            ((t - u.inner(u.start)) / u.doubt) ** 2
            for t, u in zip(solution.theta, unknowns, strict=True)
            if np.isfinite(u.doubt)
        )
    )


def loss_excess(model: Model, best: Model) -> float:
    """Return how much more a model loses than the best on the blocks that choose, in the best's units."""
    return float(model.choose.loss(best.choose).sum() - best.choose.loss(best.choose).sum())
