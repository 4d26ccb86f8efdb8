"""Pruning: no cause stays that the others make needless, or that a simpler one replaces."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import replace
from functools import partial

import numpy as np

from rsea_ros.diagnosis.fitting import Model, effect_size, fitted
from rsea_ros.diagnosis.hypothesise import extended_problem
from rsea_ros.diagnosis.judge import compare
from rsea_ros.diagnosis.search import Search
from rsea_ros.diagnosis.trial import Trial, trial_of
from rsea_ros.effects.catalogue import catalogue, effect_named
from rsea_ros.identification.problem import Case
from rsea_ros.identification.unknowns import start_vector


def pruned(found: Search, pool: Executor) -> Search:
    """Return the search with no cause more than the data need, and its models as they nest."""
    return sequenced(with_simpler(without_needless(found)), pool)


def without_needless(found: Search) -> Search:
    """Take out every accepted cause without which the others do as well."""
    last = found.last
    for name in last.causes if len(last.causes) > 1 else ():
        smaller = _changed(found.cases, last, name)
        if not compare(last.choose, smaller.choose, last.parameters - smaller.parameters).better:
            trial = trial_of(last, name, smaller, "not needed beside the other causes")
            return without_needless(_replaced(found, smaller, trial))
    return found


def with_simpler(found: Search) -> Search:
    """Put in a cause's place the simpler ones that it is said to be confused with, where they do as well."""
    last = found.last
    for name in last.causes:
        size = effect_size(name)
        for rival in _taken_for(name):
            if rival in last.causes or effect_size(rival) >= size:
                continue
            simpler = _changed(found.cases, last, name, rival)
            if not compare(last.choose, simpler.choose, last.parameters - simpler.parameters).better:
                without, why = _changed(found.cases, last, name), f"no better than {rival}, which is simpler"
                return with_simpler(_replaced(found, simpler, trial_of(last, name, without, why)))
    return found


def _taken_for(name: str) -> list[str]:
    """Return the effects that are said to be confused with one, from either side."""
    own = effect_named(name).claims.confusable_with
    return [n for n, e in catalogue().items() if n in own or name in e.claims.confusable_with]


def sequenced(found: Search, pool: Executor) -> Search:
    """Return the search with its models as they nest: from all causes back, what tells least goes first."""
    models = [found.last]
    while len(models[-1].causes) > 1:
        largest = models[-1]
        smaller = pool.map(partial(_changed, found.cases, largest), largest.causes)
        models.append(min(smaller, key=lambda m: float(m.choose.loss(largest.choose).sum())))
    nominal = [found.models[0]] if found.last.causes else []
    return replace(found, models=(*nominal, *_in_order(list(reversed(models)))))


def _in_order(models: list[Model]) -> list[Model]:
    """Return nested models with the effects of each rig in the order in which they come in."""
    order: list[str] = []
    for m in models:
        order += [name for name in m.causes if name not in order]
    return [_sorted(m, order) for m in models]


def _sorted(model: Model, order: Sequence[str]) -> Model:
    problem = model.solution.problem
    rig = problem.rig.with_effects(*sorted(problem.rig.effects, key=lambda e: order.index(e.name)))
    return replace(model, solution=replace(model.solution, problem=replace(problem, rig=rig)))


def _replaced(found: Search, last: Model, trial: Trial) -> Search:
    return replace(found, models=(found.models[0], last), trials=(*found.trials, trial))


def _changed(cases: Sequence[Case], model: Model, name: str, rival: str | None = None) -> Model:
    """Fit a model again without one of its causes, or with a rival of the same size in its place."""
    problem = model.solution.problem
    keep = [i for i, u in enumerate(problem.unknowns) if not u.name.startswith(name + ".")]
    rig = problem.rig.with_effects(*(e for e in problem.rig.effects if e.name != name))
    smaller, theta = (
        replace(problem, rig=rig, unknowns=tuple(problem.unknowns[i] for i in keep)),
        model.solution.theta[keep],
    )
    if rival is None:
        return fitted(cases, smaller, theta, weights=model.choose)
    old, new = effect_named(name).main, effect_named(rival)
    start = new.typical | (
        {new.main.name: model.solution.values[f"{name}.{old.name}"]} if old.unit == new.main.unit else {}
    )
    larger = extended_problem(smaller, new, start)
    beginning = np.concatenate([theta, start_vector(larger.unknowns)[len(theta) :]])
    return fitted(cases, larger, beginning, weights=model.choose)
