"""Choice: which of the models that were fitted beside the present one to accept, and which do as well."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rsea_ros.diagnosis.candidate import AT_FLOOR, Model
from rsea_ros.diagnosis.data_split import Score
from rsea_ros.diagnosis.judge import compare
from rsea_ros.diagnosis.trial import Trial
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


def is_progress(model: Model, present: Model) -> bool:
    """Tell whether a model is surely better, and by enough: a share of a channel's residual, or all of it.

    One whose newest effect has run to its bound is none: that bends to something else.
    """
    if at_bound(model.solution):
        return False
    if not compare(model.choose, present.choose, model.parameters - present.parameters).better:
        return False
    if worst(model) < AT_FLOOR:
        return True
    if len(model.causes) != len(present.causes) + 1 or (len(present.causes) >= _FEW and is_far(model)):
        return worst(model) < (1.0 - _MUCH) * worst(present)
    fall = max(1.0 - model.choose.ratio(n) / max(present.choose.ratio(n), 1e-12) for n in model.choose.sums)
    return fall > _ENOUGH


def choose(models: Sequence[Model], present: Score) -> tuple[Model | None, tuple[Model, ...]]:
    """Return the model to accept and those that do as well with no more parameters.

    Of all that are not surely and materially worse than the best the simplest; of equals, the one that needs
    the least of what is known beforehand.
    """
    if not models:
        return None, ()
    best = min(models, key=lambda m: float(m.choose.loss(present).sum()))
    contenders = [
        m for m in models if m is best or not compare(best.choose, m.choose).better or is_near(m, best)
    ]

    def order(m: Model) -> tuple[int, float]:
        return m.size, prior_cost(m.solution) + loss_excess(m, best)

    simplest = min(contenders, key=order)
    return simplest, tuple(m for m in contenders if m is not simplest and m.size <= simplest.size)


def is_near(model: Model, best: Model) -> bool:
    """Tell whether a simpler model does nearly as well as the best, which is far from the floor.

    There what is left is no noise, and more parameters always bend a model a little nearer to it.
    """
    if not is_far(best):
        return False
    room = 1.0 + _ROOM * (best.size - model.size)
    return float(model.choose.loss(best.choose).sum()) < room**2 * float(best.choose.loss(best.choose).sum())


def as_well(model: Model, other: Model) -> bool:
    """Tell whether a model loses no more than another on the blocks that choose, within a tenth."""
    return float(model.choose.loss(other.choose).sum()) < (1.0 + _ROOM) * float(
        other.choose.loss(other.choose).sum()
    )


def is_far(model: Model) -> bool:
    """Tell whether a model is far from the floor in its worst channel."""
    return worst(model) >= _FAR


def worst(model: Model) -> float:
    """Return the RMS of the residual over the noise in the worst channel."""
    return max(model.choose.ratio(n) for n in model.choose.sums)


def at_bound(solution: Solution) -> bool:
    """Tell whether the newest effect's main parameter has run to its bound: then it is no such effect."""
    effect = effect_named(solution.problem.rig.effects[-1].name)
    value = solution.values[f"{effect.name}.{effect.main.name}"]
    span = effect.main.high - effect.main.low
    return not effect.main.low + _NEAR * span < value < effect.main.high - _NEAR * span


def prior_cost(solution: Solution | Trial) -> float:
    """Return what the fit paid for leaving the values that were known beforehand."""
    unknowns: Sequence[Unknown] = solution.problem.unknowns
    return float(
        sum(
            ((t - u.inner(u.start)) / u.doubt) ** 2
            for t, u in zip(solution.theta, unknowns, strict=True)
            if np.isfinite(u.doubt)
        )
    )


def is_likelier(model: Model, other: Model) -> bool:
    """Tell whether a model that does as well as another needs clearly less of what is known beforehand."""
    return prior_cost(model.solution) + loss_excess(model, other) < prior_cost(other.solution) - _CLEARLY


def loss_excess(model: Model, best: Model) -> float:
    """Return how much more a model loses than the best on the blocks that choose, in the best's units."""
    return float(model.choose.loss(best.choose).sum() - best.choose.loss(best.choose).sum())
