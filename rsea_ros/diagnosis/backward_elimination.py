"""Pruning: no cause stays that the others make needless, or that a simpler or likelier one replaces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial

from rsea_ros.diagnosis.candidate import Candidate, effect_size, fit_candidate
from rsea_ros.diagnosis.criteria import costs_priors_less, is_far_from_floor
from rsea_ros.diagnosis.initial_guess import ResidualView, initial_guesses
from rsea_ros.diagnosis.judge import preference
from rsea_ros.diagnosis.screening import screen, without_effect
from rsea_ros.diagnosis.stepwise import Selection
from rsea_ros.diagnosis.trial import Trial, trial_of
from rsea_ros.effects.catalogue import effect_named, look_alikes
from rsea_ros.effects.effect import Effect
from rsea_ros.identification.problem import Case, Problem
from rsea_ros.identification.unknowns import apply
from rsea_ros.identification.workers import Pools
from rsea_ros.signals import FloatArray


def eliminate_backwards(selection: Selection, effects: Sequence[Effect], pools: Pools) -> Selection:
    """Return the search with no cause more than the data need, and its models as they nest."""
    reduced_models = ReducedModels(selection.cases, effects, pools)
    return nested_sequence(
        with_replacements(without_redundant(selection, reduced_models), reduced_models), reduced_models
    )


@dataclass(frozen=True)
class ReducedModels:
    """Fits models again without one of their causes, or with another in its place; each only once."""

    cases: tuple[Case, ...]
    effects: Sequence[Effect]
    pools: Pools
    known: dict[tuple[str, ...], dict[str, Candidate]] = field(default_factory=dict)

    def without(self, model: Candidate) -> dict[str, Candidate]:
        """Return by cause the model without it."""
        if model.causes not in self.known:
            selection = self.pools.fits.map(partial(self._less, model), model.causes)
            self.known[model.causes] = dict(zip(model.causes, selection, strict=True))
        return self.known[model.causes]

    def with_rivals(self, model: Candidate) -> list[tuple[str, str, Candidate]]:
        """Return cause, another effect that it is said to be confused with, and the model with that.

        The other is simpler, or as simple where the choice between them was made without the other causes
        and the model is near the floor: far from it priors say nothing.
        """
        as_simple = len(model.causes) > 1 and not is_far_from_floor(model)
        pairs = [
            (name, rival)
            for name in model.causes
            for rival in look_alikes(name, self.effects)
            if rival.name not in model.solution.problem.acting
            and effect_size(rival.name) < effect_size(name) + as_simple
        ]
        rests = self.without(model) if pairs else {}
        selection = self.pools.fits.map(lambda pair: self._with(model, rests[pair[0]], *pair), pairs)
        return [
            (name, rival.name, m) for (name, rival), m in zip(pairs, selection, strict=True) if m is not None
        ]

    def _less(self, model: Candidate, name: str) -> Candidate:
        """Fit a model again without one of its causes."""
        return self._fitted(model, *without_effect(model.solution.problem, model.solution.theta, name))

    def _with(self, model: Candidate, rest: Candidate, name: str, rival: Effect) -> Candidate | None:
        """Fit a model again with a rival, of the same size where that is one, in the place of a cause."""
        old, there = effect_named(name).main, rest.solution
        same = {rival.main.name: model.solution.values[f"{name}.{old.name}"]}
        rig, _ = apply(there.problem.rig, there.problem.unknowns, there.theta)
        starts = initial_guesses(rival, ResidualView(self.cases[0], rig, rest.outputs[0]))
        starts += [{**rival.typical, **same}] if old.unit == rival.main.unit else []
        begun = screen(there, rival, starts)
        return None if begun is None else self._fitted(model, begun.problem, begun.theta)

    def _fitted(self, model: Candidate, problem: Problem, theta: FloatArray) -> Candidate:
        """Fit what is left or made of a model as that was."""
        run, far = self.pools.run, is_far_from_floor(model)
        return fit_candidate(self.cases, problem, theta, weights=model.validation, run=run, quick=far)


def without_redundant(selection: Selection, reduced_models: ReducedModels) -> Selection:
    """Take out every accepted cause without which the others do as well."""
    last = selection.last
    for name, rest in reduced_models.without(last).items() if len(last.causes) > 1 else ():
        if not preference(last.validation, rest.validation, last.parameters - rest.parameters).better:
            trial = trial_of(last, name, rest, "redundant")
            return without_redundant(_replaced(selection, rest, trial), reduced_models)
    return selection


def with_replacements(selection: Selection, reduced_models: ReducedModels) -> Selection:
    """Put in a cause's place one that it is said to be confused with, if that is simpler or likelier."""
    last = selection.last
    for name, rival, other in reduced_models.with_rivals(last):
        if preference(last.validation, other.validation, last.parameters - other.parameters).better:
            continue
        without = reduced_models.without(last)[name]
        if other.size < last.size:
            trial = trial_of(last, name, without, "no_better_than_simpler", rival)
            return with_replacements(_replaced(selection, other, trial), reduced_models)
        if costs_priors_less(other, last):
            trial = trial_of(last, name, without, "no_better_than_likelier", rival)
            swapped = _replaced(selection, other, trial)
            equal = _sorted(last, [*(c for c in last.causes if c != name), name])
            return with_replacements(
                replace(swapped, rivals={**selection.rivals, rival: (equal,)}), reduced_models
            )
    return selection


def nested_sequence(selection: Selection, reduced_models: ReducedModels) -> Selection:
    """Return the search with its models as they nest: from all causes back, what tells least goes first."""
    models = [selection.last]
    while len(models[-1].causes) > 1:
        largest = models[-1]
        rests = reduced_models.without(largest).values()
        models.append(min(rests, key=lambda m: float(m.validation.loss(largest.validation).sum())))
    nominal = [selection.models[0]] if selection.last.causes else []
    return replace(selection, models=(*nominal, *_in_order(list(reversed(models)))))


def _in_order(models: list[Candidate]) -> list[Candidate]:
    """Return nested models with the effects of each rig in the order in which they come in."""
    order: list[str] = []
    for m in models:
        order += [name for name in m.causes if name not in order]
    return [_sorted(m, order) for m in models]


def _sorted(model: Candidate, order: Sequence[str]) -> Candidate:
    problem = model.solution.problem
    stated = [name for name in problem.acting if name in problem.stated]
    place = {name: k for k, name in enumerate([*stated, *order])}
    rig = problem.rig.with_effects(*sorted(problem.rig.effects, key=lambda e: place[e.name]))
    return replace(model, solution=replace(model.solution, problem=replace(problem, rig=rig)))


def _replaced(selection: Selection, last: Candidate, trial: Trial) -> Selection:
    return replace(selection, models=(selection.models[0], last), trials=(*selection.trials, trial))
