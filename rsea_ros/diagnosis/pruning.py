"""Pruning: no cause stays that the others make needless, or that a simpler or likelier one replaces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial

from rsea_ros.diagnosis.choice import is_far, is_likelier
from rsea_ros.diagnosis.fitting import Model, effect_size, fitted
from rsea_ros.diagnosis.hypothesise import extended, reduced
from rsea_ros.diagnosis.judge import compare
from rsea_ros.diagnosis.search import Search
from rsea_ros.diagnosis.trial import Trial, trial_of
from rsea_ros.diagnosis.workers import Workers
from rsea_ros.effects.catalogue import effect_named, look_alikes
from rsea_ros.effects.effect import Effect
from rsea_ros.identification.problem import Case


def pruned(found: Search, effects: Sequence[Effect], at_work: Workers) -> Search:
    """Return the search with no cause more than the data need, and its models as they nest."""
    smaller = Smaller(found.cases, effects, at_work)
    return sequenced(with_better(without_needless(found, smaller), smaller), smaller)


@dataclass(frozen=True)
class Smaller:
    """Fits models again without one of their causes, or with another in its place; each only once."""

    cases: tuple[Case, ...]
    effects: Sequence[Effect]
    at_work: Workers
    known: dict[tuple[str, ...], dict[str, Model]] = field(default_factory=dict)

    def without(self, model: Model) -> dict[str, Model]:
        """Return by cause the model without it."""
        if model.causes not in self.known:
            found = self.at_work.fits.map(partial(self._changed, model), model.causes)
            self.known[model.causes] = dict(zip(model.causes, found, strict=True))
        return self.known[model.causes]

    def with_rivals(self, model: Model) -> list[tuple[str, str, Model]]:
        """Return cause, another effect that it is said to be confused with, and the model with that.

        The other is simpler, or as simple where the choice between them was made without the other causes
        and the model is near the floor: far from it priors say nothing.
        """
        as_simple = len(model.causes) > 1 and not is_far(model)
        pairs = [
            (name, rival.name)
            for name in model.causes
            for rival in look_alikes(name, self.effects)
            if rival.name not in model.causes and effect_size(rival.name) < effect_size(name) + as_simple
        ]
        found = self.at_work.fits.map(lambda pair: self._changed(model, *pair), pairs)
        return [(*pair, other) for pair, other in zip(pairs, found, strict=True)]

    def _changed(self, model: Model, name: str, rival: str | None = None) -> Model:
        """Fit a model again without one of its causes, or with a rival of the same size in its place."""
        far = is_far(model)
        smaller, theta = reduced(model.solution.problem, model.solution.theta, name)
        if rival is None:
            return fitted(self.cases, smaller, theta, weights=model.choose, run=self.at_work.run, quick=far)
        old, new = effect_named(name).main, effect_named(rival)
        start = new.typical | (
            {new.main.name: model.solution.values[f"{name}.{old.name}"]} if old.unit == new.main.unit else {}
        )
        larger, beginning = extended(smaller, theta, new, start)
        return fitted(self.cases, larger, beginning, weights=model.choose, run=self.at_work.run, quick=far)


def without_needless(found: Search, smaller: Smaller) -> Search:
    """Take out every accepted cause without which the others do as well."""
    last = found.last
    for name, rest in smaller.without(last).items() if len(last.causes) > 1 else ():
        if not compare(last.choose, rest.choose, last.parameters - rest.parameters).better:
            trial = trial_of(last, name, rest, "not needed beside the other causes")
            return without_needless(_replaced(found, rest, trial), smaller)
    return found


def with_better(found: Search, smaller: Smaller) -> Search:
    """Put in a cause's place one that it is said to be confused with, if that is simpler or likelier."""
    last = found.last
    for name, rival, other in smaller.with_rivals(last):
        if compare(last.choose, other.choose, last.parameters - other.parameters).better:
            continue
        without = smaller.without(last)[name]
        if other.size < last.size:
            why = f"no better than {rival}, which is simpler"
            return with_better(_replaced(found, other, trial_of(last, name, without, why)), smaller)
        if is_likelier(other, last):
            why = f"no better than {rival}, which needs less of what is known beforehand"
            swapped = _replaced(found, other, trial_of(last, name, without, why))
            equal = _sorted(last, [*(c for c in last.causes if c != name), name])
            return with_better(replace(swapped, rivals={**found.rivals, rival: (equal,)}), smaller)
    return found


def sequenced(found: Search, smaller: Smaller) -> Search:
    """Return the search with its models as they nest: from all causes back, what tells least goes first."""
    models = [found.last]
    while len(models[-1].causes) > 1:
        largest = models[-1]
        rests = smaller.without(largest).values()
        models.append(min(rests, key=lambda m: float(m.choose.loss(largest.choose).sum())))
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
