"""Pruning: no cause stays that the others make needless, or that a simpler or likelier one replaces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial

from rsea_ros.diagnosis.candidate import Model, effect_size, fitted
from rsea_ros.diagnosis.criteria import is_far, is_likelier
from rsea_ros.diagnosis.initial_guess import Seen, starts_of
from rsea_ros.diagnosis.judge import compare
from rsea_ros.diagnosis.screening import reduced, screen
from rsea_ros.diagnosis.stepwise import Search
from rsea_ros.diagnosis.trial import Trial, trial_of
from rsea_ros.diagnosis.workers import Workers
from rsea_ros.effects.catalogue import effect_named, look_alikes
from rsea_ros.effects.effect import Effect
from rsea_ros.identification.problem import Case, Problem
from rsea_ros.identification.unknowns import apply
from rsea_ros.signals import FloatArray


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
            found = self.at_work.fits.map(partial(self._less, model), model.causes)
            self.known[model.causes] = dict(zip(model.causes, found, strict=True))
        return self.known[model.causes]

    def with_rivals(self, model: Model) -> list[tuple[str, str, Model]]:
        """Return cause, another effect that it is said to be confused with, and the model with that.

        The other is simpler, or as simple where the choice between them was made without the other causes
        and the model is near the floor: far from it priors say nothing.
        """
        as_simple = len(model.causes) > 1 and not is_far(model)
        pairs = [
            (name, rival)
            for name in model.causes
            for rival in look_alikes(name, self.effects)
            if rival.name not in model.causes and effect_size(rival.name) < effect_size(name) + as_simple
        ]
        rests = self.without(model) if pairs else {}
        found = self.at_work.fits.map(lambda pair: self._with(model, rests[pair[0]], *pair), pairs)
        return [(name, rival.name, m) for (name, rival), m in zip(pairs, found, strict=True) if m is not None]

    def _less(self, model: Model, name: str) -> Model:
        """Fit a model again without one of its causes."""
        return self._fitted(model, *reduced(model.solution.problem, model.solution.theta, name))

    def _with(self, model: Model, rest: Model, name: str, rival: Effect) -> Model | None:
        """Fit a model again with a rival, of the same size where that is one, in the place of a cause."""
        old, there = effect_named(name).main, rest.solution
        same = {rival.main.name: model.solution.values[f"{name}.{old.name}"]}
        rig, _ = apply(there.problem.rig, there.problem.unknowns, there.theta)
        starts = starts_of(rival, Seen(self.cases[0], rig, rest.outputs[0]))
        starts += [{**rival.typical, **same}] if old.unit == rival.main.unit else []
        begun = screen(there, rival, starts)
        return None if begun is None else self._fitted(model, begun.problem, begun.theta)

    def _fitted(self, model: Model, problem: Problem, theta: FloatArray) -> Model:
        """Fit what is left or made of a model as that was."""
        run, far = self.at_work.run, is_far(model)
        return fitted(self.cases, problem, theta, weights=model.choose, run=run, quick=far)


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
