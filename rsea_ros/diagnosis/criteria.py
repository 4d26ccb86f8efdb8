"""Choice: which of the models that were fitted beside the present one to accept, and which do as well."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rsea_ros.diagnosis.candidate import AT_FLOOR, Candidate
from rsea_ros.diagnosis.data_split import Score
from rsea_ros.diagnosis.judge import preference
from rsea_ros.diagnosis.result import Reason
from rsea_ros.effects.catalogue import effect_named
from rsea_ros.identification.solver import Solution
from rsea_ros.identification.unknowns import Unknown

_NEAR = 1e-6
_FAR = 5.0
"""RMS of the residual over the noise, in the worst channel, above which a model is far from the floor."""
_ROOM = 0.1
"""How much larger the residual of a simpler model may be there, for each parameter that it saves."""
_ENOUGH, _MUCH = 0.1, 0.3
"""Relative fall of the residual that counts above the floor: of any channel, of the worst where in doubt.

Doubtful are two causes at once, another in the place of one, and a third beside two that leaves much: such
bend to whatever is there.
"""
_FEW = 2
_CLEARLY = 1.0
"""Fall of what the priors cost that counts: odds of 1.6 to 1."""


def is_acceptable(model: Candidate, present: Candidate) -> bool:
    """Tell whether a model is surely better, and by enough: a share of a channel's residual, or all of it."""
    return refusal(model, present) is None


def refusal(model: Candidate, present: Candidate) -> Reason | None:
    """Return why a model is no progress over the present one; None where it is.

    One whose newest effect has run to its bound is none: that bends to something else.
    """
    if at_bound(model.solution):
        return "at_bound"
    over_present = preference(model.validation, present.validation, model.parameters - present.parameters)
    if not over_present.better:
        return "too_small" if over_present.sure else "not_sure"
    if worst_ratio(model) < AT_FLOOR:
        return None
    if len(model.causes) != len(present.causes) + 1 or (
        len(present.causes) >= _FEW and is_far_from_floor(model)
    ):
        return None if worst_ratio(model) < (1.0 - _MUCH) * worst_ratio(present) else "too_small"
    fall = max(
        1.0 - model.validation.ratio(n) / max(present.validation.ratio(n), 1e-12)
        for n in model.validation.sums
    )
    return None if fall > _ENOUGH else "too_small"


def break_tie(models: Sequence[Candidate], present: Score) -> tuple[Candidate | None, tuple[Candidate, ...]]:
    """Return the model to accept and those that do as well with no more parameters.

    Of all that are not surely and materially worse than the best the simplest; of equals, the one that needs
    the least of what is known beforehand.
    """
    if not models:
        return None, ()
    best = min(models, key=lambda m: float(m.validation.loss(present).sum()))
    contenders = [
        m
        for m in models
        if m is best or not preference(best.validation, m.validation).better or is_nearly_as_good(m, best)
    ]

    def order(m: Candidate) -> tuple[int, float]:
        return m.size, prior_cost(m.solution) + loss_excess(m, best)

    simplest = min(contenders, key=order)
    return simplest, tuple(m for m in contenders if m is not simplest and m.size <= simplest.size)


def is_nearly_as_good(model: Candidate, best: Candidate) -> bool:
    """Tell whether a simpler model does nearly as well as the best, which is far from the floor.

    There what is left is no noise, and more parameters always bend a model a little nearer to it.
    """
    if not is_far_from_floor(best):
        return False
    room = 1.0 + _ROOM * (best.size - model.size)
    return float(model.validation.loss(best.validation).sum()) < room**2 * float(
        best.validation.loss(best.validation).sum()
    )


def is_equally_good(model: Candidate, other: Candidate) -> bool:
    """Tell whether a model loses no more than another on the blocks that choose, within a tenth."""
    return float(model.validation.loss(other.validation).sum()) < (1.0 + _ROOM) * float(
        other.validation.loss(other.validation).sum()
    )


def is_far_from_floor(model: Candidate) -> bool:
    """Tell whether a model is far from the floor in its worst channel."""
    return worst_ratio(model) >= _FAR


def worst_ratio(model: Candidate) -> float:
    """Return the RMS of the residual over the noise in the worst channel."""
    return max(model.validation.ratio(n) for n in model.validation.sums)


def at_bound(solution: Solution) -> bool:
    """Tell whether the newest effect's main parameter has run to its bound: then it is no such effect."""
    effect = effect_named(solution.problem.added[-1])
    value = solution.values[f"{effect.name}.{effect.main.name}"]
    span = effect.main.high - effect.main.low
    return not effect.main.low + _NEAR * span < value < effect.main.high - _NEAR * span


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


def costs_priors_less(model: Candidate, other: Candidate) -> bool:
    """Tell whether a model that does as well as another needs clearly less of what is known beforehand."""
    return prior_cost(model.solution) + loss_excess(model, other) < prior_cost(other.solution) - _CLEARLY


def loss_excess(model: Candidate, best: Candidate) -> float:
    """Return how much more a model loses than the best on the blocks that choose, in the best's units."""
    return float(model.validation.loss(best.validation).sum() - best.validation.loss(best.validation).sum())
