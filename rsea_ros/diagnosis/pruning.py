"""Pruning: no cause stays that the others make needless, or that a simpler one replaces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rsea_ros.diagnosis.fitting import Model, fitted
from rsea_ros.diagnosis.hypothesise import extended_problem
from rsea_ros.diagnosis.judge import compare
from rsea_ros.diagnosis.search import Search
from rsea_ros.diagnosis.trial import Trial, trial_of
from rsea_ros.effects.catalogue import effect_named
from rsea_ros.identification.problem import Case
from rsea_ros.identification.unknowns import start_vector


def pruned(found: Search) -> Search:
    """Return the search with no cause more than the data need, and its models as they nest."""
    return sequenced(with_simpler(without_needless(found)))


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
        size = len(effect_named(name).parameters)
        for rival in effect_named(name).claims.confusable_with:
            if rival in last.causes or len(effect_named(rival).parameters) >= size:
                continue
            simpler = _changed(found.cases, last, name, rival)
            if not compare(last.choose, simpler.choose, last.parameters - simpler.parameters).better:
                without, why = _changed(found.cases, last, name), f"no better than {rival}, which is simpler"
                return with_simpler(_replaced(found, simpler, trial_of(last, name, without, why)))
    return found


def sequenced(found: Search) -> Search:
    """Return the search with its models as they nest: the nominal one, then one cause more each time."""
    model, models = found.last, [found.last]
    for name in reversed(found.last.causes[1:]):
        model = _changed(found.cases, model, name)
        models.append(model)
    nominal = [found.models[0]] if found.last.causes else []
    return replace(found, models=(*nominal, *reversed(models)))


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
