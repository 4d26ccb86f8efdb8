"""Backward elimination: no cause stays that the others make redundant, or that a simpler one replaces."""

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from rsea_ros.diagnosis import candidate, criteria
from rsea_ros.diagnosis.candidate import Candidate, FitSetup
from rsea_ros.diagnosis.evaluation import Selection, Trial, trial_of
from rsea_ros.diagnosis.initial_guess import initial_guesses, view_for
from rsea_ros.diagnosis.result import Reason
from rsea_ros.diagnosis.settings import DiagnosisSettings
from rsea_ros.diagnosis.step_fits import QUICK_FIT, screen
from rsea_ros.effects.catalogue import effect_named, look_alikes
from rsea_ros.effects.effect import Effect
from rsea_ros.effects.guess import Guess
from rsea_ros.errors import RseaError
from rsea_ros.identification.fit import add_effect
from rsea_ros.identification.problem import Problem
from rsea_ros.identification.solver import Pools, Solution, bounded_step, jacobian_columns
from rsea_ros.identification.unknowns import apply, start_vector
from rsea_ros.model.rig import FIELDS
from rsea_ros.records.record import FloatArray


def eliminate_backwards(
    selection: Selection, effects: Sequence[Effect], pools: Pools, settings: DiagnosisSettings
) -> Selection:
    """Return the selection with no cause more than the data need, and its models as they nest."""
    models = ReducedModels(effects, pools, settings)
    selection = without_redundant(selection, models)
    selection = with_replacements(selection, models)
    return nested_sequence(selection, models)


@dataclass(frozen=True)
class ReducedModels:
    """Fits models again without one of their causes, or with another in its place; each only once."""

    effects: Sequence[Effect]
    pools: Pools
    settings: DiagnosisSettings
    fitted: dict[tuple[str, ...], dict[str, Candidate]] = field(default_factory=dict)

    def without(self, model: Candidate) -> dict[str, Candidate]:
        """Return by cause the model without it."""
        if model.causes not in self.fitted:
            models = self.pools.fits.map(partial(self._without, model), model.causes)
            self.fitted[model.causes] = dict(zip(model.causes, models, strict=True))
        return self.fitted[model.causes]

    def with_rivals(
        self, model: Candidate, trials: Sequence[Trial] = ()
    ) -> list[tuple[str, str, Candidate]]:
        """Return a cause, an effect in its place, and the model with that.

        That is a listed look-alike, one that was fitted to all training blocks at some step, or that a step
        could not try: beside other causes a mode above the band stands in for a delay. It is simpler, or as
        simple where the choice between them was made without the other causes and the model is near the
        floor: far from it priors say nothing.
        trials: of the steps forward. Where one was of the same effects, the fit begins with what it reached.
        """
        as_simple = len(model.causes) > 1 and not self._is_far(model)
        fitted = {t.name for t in trials if t.is_full and t.reason != "at_bound"}
        searched = {t.beside.causes: t.beside.problem for t in trials}.values()
        barred = {e.name for e in self.effects if not all(candidate.is_apart(e, p) for p in searched)}
        pairs = [
            (name, rival)
            for name in model.causes
            for rival in self.effects
            if (rival.name in fitted | barred or is_listed(rival, name))
            and rival.name not in model.problem.acting and candidate.is_apart(rival, model.problem)
            and candidate.effect_size(rival.name) < candidate.effect_size(name) + as_simple
        ]
        rests = self.without(model) if pairs else {}
        tried = partial(self._with, model, rests, trials)
        models = self.pools.fits.map(lambda pair: tried(*pair), pairs)
        return [
            (name, rival.name, m) for (name, rival), m in zip(pairs, models, strict=True) if m is not None
        ]

    def is_needed(self, model: Candidate, without: Candidate) -> bool:
        """Return whether a model is better than without one of its causes, or with another in its place."""
        extra, rule = model.parameters - without.parameters, self.settings.acceptance
        better = criteria.preference(model.validation, without.validation, extra, rule).better
        return better or criteria.keeps_known_values(model, without, self.settings)

    def _without(self, model: Candidate, name: str) -> Candidate:
        """Fit a model again without one of its causes."""
        return self._fit(model, *candidate.without_effect(model.problem, model.solution.theta, name))

    def _with(
        self, model: Candidate, rests: Mapping[str, Candidate], trials: Sequence[Trial], name: str,
        rival: Effect,
    ) -> Candidate | None:  # fmt: skip
        """Fit a model again with a rival, of the same size where that is one, in the place of a cause."""
        rest, old = rests[name], effect_named(name).main
        solution = rest.solution
        same = {rival.main.name: model.solution.values[f"{name}.{old.name}"]}
        tried = [t for t in trials if t.name == rival.name and set(t.beside.causes) == set(rest.causes)]
        guesses = [fitted_parameters(t, rival) for t in tried[-1:]]
        if not guesses:
            rig, _ = apply(rest.problem.rig, rest.problem.unknowns, solution.theta)
            guesses = initial_guesses(rival, view_for(rival, model.cases, rig, rest.outputs))
        guesses += [{**rival.typical, **same}] if old.unit == rival.main.unit else []
        can_be_nothing = math.isfinite(old.null) and not old.logarithmic
        with suppress(RseaError):  # an effect that the rig cannot have
            guesses += [in_exchange(model.solution, name, rival)] if can_be_nothing else []
        screened = screen(solution, rival, guesses)
        close = self.settings.forward.behind_first * model.solution.cost
        if screened is None or not (is_listed(rival, name) or screened.cost < close):
            return None
        setup = replace(self._setup(model), is_quick=True, iterations=QUICK_FIT)
        quick = candidate.fit_candidate(setup, screened.problem, screened.theta)
        if self._is_far(quick) and not self._is_far(model):  # more steps would not bring it near
            return quick
        return self._fit(model, screened.problem, quick.solution.theta)

    def _fit(self, model: Candidate, problem: Problem, theta: FloatArray) -> Candidate:
        """Fit a problem as a model was fitted from which it was made."""
        return candidate.fit_candidate(self._setup(model), problem, theta)

    def _setup(self, model: Candidate) -> FitSetup:
        """Return how a model was fitted."""
        is_quick = self._is_far(model)
        return FitSetup(model.cases, self.settings, self.pools.run, model.validation, is_quick=is_quick)

    def _is_far(self, model: Candidate) -> bool:
        return criteria.is_far_from_floor(model, self.settings)


def in_exchange(solution: Solution, name: str, rival: Effect) -> Guess:
    """Return where an effect stands in for a cause of a solution, to first order.

    The cause is nothing there, and along the derivatives all other unknowns make the best of it with the
    rival: between two scales of the torque inertia, damping and stiffness change with them.
    """
    main, cause = rival.main, effect_named(name).main
    start = {**rival.typical, main.name: main.null if math.isfinite(main.null) else main.typical}
    problem, theta = add_effect(solution.problem, solution.theta, rival, start)
    residual, new = problem.residual(theta), range(len(solution.theta), len(theta))
    matrix = np.column_stack([solution.jacobian, jacobian_columns(problem, theta, residual, new)])
    names, own = [u.name for u in problem.unknowns], f"{name}."
    at, free = names.index(own + cause.name), [k for k, n in enumerate(names) if not n.startswith(own)]
    left = residual + matrix[:, at] * (problem.unknowns[at].inner(cause.null) - theta[at])
    rest, begin = candidate.without_effect(problem, theta, name)
    weight, others = np.array([u.doubt for u in rest.unknowns]) ** -2.0, matrix[:, free]
    slope = others.T @ left + weight * (begin - start_vector(rest.unknowns))
    end = bounded_step(rest, begin, others.T @ others + np.diag(weight), slope)
    moved = {u.name: u.outer(t) for u, t in zip(rest.unknowns, end.tolist(), strict=True)}
    return {n.removeprefix(f"{rival.name}."): value for n, value in moved.items()}


def is_listed(effect: Effect, name: str) -> bool:
    """Return whether an effect lists another as its look-alike, or is listed by it."""
    return bool(look_alikes(name, [effect]))


def without_redundant(selection: Selection, models: ReducedModels) -> Selection:
    """Remove every accepted cause without which the others do as well."""
    last = selection.last
    for name, rest in models.without(last).items() if len(last.causes) > 1 else ():
        if not models.is_needed(last, rest):
            trial = trial_of(last, name, rest, "redundant")
            return without_redundant(_replace(selection, rest, trial), models)
    return selection


def with_replacements(selection: Selection, models: ReducedModels) -> Selection:
    """Replace a cause by what is simpler or likelier in its place, and keep what is not as contenders."""
    last, contenders = selection.last, dict[str, tuple[Trial, ...]]()
    for name, rival, other in models.with_rivals(last, selection.trials):
        without, reason = models.without(last)[name], _prefers(last, other, models)
        if reason != "explains_less":
            swapped = _replace(selection, other, trial_of(last, name, without, reason, rival))
            return with_replacements(without_redundant(swapped, models), models)
        beaten = trial_of(other, rival, without, reason, name)
        contenders[name] = (*contenders.get(name, ()), beaten)
    return replace(selection, contenders=contenders)


def _prefers(last: Candidate, other: Candidate, models: ReducedModels) -> Reason:
    """Return why another model is to be preferred to the last one, or that it explains less."""
    if models.is_needed(last, other):
        return "explains_less"
    if other.size < last.size:
        return "no_better_than_simpler"
    is_likelier = criteria.costs_priors_less(other, last, models.settings)
    return "no_better_than_likelier" if is_likelier else "explains_less"


def nested_sequence(selection: Selection, models: ReducedModels) -> Selection:
    """Return the selection with nested models: from all causes back, the least useful goes first.

    That is the one without which the model is the likeliest, known values of the rig considered.
    """
    if not selection.last.causes:
        return replace(selection, models=(selection.last,))
    nested = [selection.last]
    while len(nested[-1].causes) > 1:
        largest = nested[-1]
        rests = models.without(largest).values()
        nested.append(max(rests, key=lambda m: criteria.likelier_by(m, largest, models.settings.floor.far)))
    return replace(selection, models=(selection.models[0], *_in_order(list(reversed(nested)))))


def fitted_parameters(trial: Trial, effect: Effect) -> Guess:
    """Return the parameters of an effect that its trial reached; of a mode, the rig's values with them.

    Not those with a prior, which lies around where a fit begins.
    """
    unknowns = zip(trial.problem.unknowns, trial.theta, strict=True)
    values = {u.name: u.outer(float(t)) for u, t in unknowns}
    rig = {n: v for n, v in values.items() if n in FIELDS} if "mode" in effect.tags else {}
    mine = {p.name: f"{effect.name}.{p.name}" for p in effect.parameters if math.isinf(p.spread)}
    return {**rig, **{p: values[n] for p, n in mine.items() if n in values}}


def _in_order(models: list[Candidate]) -> list[Candidate]:
    """Return nested models with the effects of each rig in the order in which they come in."""
    ordered: list[Candidate] = []
    known: tuple[str, ...] = ()
    for m in models:
        (newest,) = (name for name in m.causes if name not in known)
        ordered.append(_order_causes(m, known, newest))
        known = (*known, newest)
    return ordered


def _order_causes(model: Candidate, earlier: Sequence[str], newest: str) -> Candidate:
    """Return a model with its causes in an order, after the effects that the rig states."""
    problem, order = model.problem, (*earlier, newest)
    stated = [name for name in problem.acting if name in problem.stated]
    place = {name: k for k, name in enumerate([*stated, *order])}
    rig = problem.rig.with_effects(*sorted(problem.rig.effects, key=lambda e: place[e.name]))
    return replace(model, solution=replace(model.solution, problem=replace(problem, rig=rig, newest=newest)))


def _replace(selection: Selection, last: Candidate, trial: Trial) -> Selection:
    return replace(selection, models=(selection.models[0], last), trials=(*selection.trials, trial))
