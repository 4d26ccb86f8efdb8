"""Stepwise selection: from the re-fitted nominal model, cause after cause, until no effect helps any more.

All are screened and the promising fitted on short pieces of the data; the best of those are fitted to all
training blocks. Where none is acceptable, effects on the measured rotor angle are tried, then two at once.
Two at once are also tried where the best fits only far from the rig. Backwards no cause stays that the others
make redundant, or that a simpler one replaces.

Models are fitted to the training blocks and chosen on the validation blocks; the test blocks are not touched.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import NamedTuple

import numpy as np

from rsea_ros.diagnosis import candidate, criteria
from rsea_ros.diagnosis.candidate import Candidate, FitSetup
from rsea_ros.diagnosis.evaluation import Selection, Trial, trial_of
from rsea_ros.diagnosis.initial_guess import initial_guesses, view_for
from rsea_ros.diagnosis.result import Reason
from rsea_ros.diagnosis.settings import DiagnosisSettings
from rsea_ros.diagnosis.step_fits import QUICK_FIT, ScreenedEffect, StepFits, screen
from rsea_ros.effects.catalogue import effect_named, look_alikes
from rsea_ros.effects.effect import Effect
from rsea_ros.effects.guess import Guess
from rsea_ros.errors import RseaError
from rsea_ros.identification.confidence import is_off_rig
from rsea_ros.identification.fit import add_effect
from rsea_ros.identification.problem import Problem
from rsea_ros.identification.solver import Pools, Solution, bounded_step, jacobian_columns, solve
from rsea_ros.identification.unknowns import LOOP_CLOCK, apply, start_vector, theta_with, vector_of
from rsea_ros.model.rig import FIELDS, Rig
from rsea_ros.progress import Progress
from rsea_ros.records.record import FloatArray

_HOPE, _HOPE_OF_TWO = 0.98, 0.9
"""Of the current cost on pieces: no hope above it, of one effect and of two."""
_NEXT = 1.1
"""Of the best cost on pieces: how close those after the first few must be."""
_ALIKE = 0.02
"""Of the loss: a rival so close is refused for its size, not its fit."""
_PAIRED, _PAIR_FITS = 3, 2
"""Effects with which pairs begin, and partners that each is tried with; pairs that are fitted to all training
blocks."""


class StepResult(NamedTuple):
    """The model to accept, if any, and all other trials."""

    accepted: Candidate | None
    trials: list[Trial]


@dataclass(frozen=True)
class ForwardStep:
    """The input of a step: the current model, the effects to try, and the number of earlier steps."""

    current: Candidate
    effects: Sequence[Effect]
    number: int
    pools: Pools
    tell: Progress
    settings: DiagnosisSettings

    def run(self) -> StepResult:
        """Try every effect, and two at once where none helps alone."""
        screened = self.fits.screen(self.fits.on_pieces)
        best = screened[: self.settings.forward.piece_fits]  # also where no step helped: a guess may be poor
        close = sorted(self.fits.fit_pieces(best), key=lambda s: s.cost)
        finalists = self._finalists(screened, close)
        models = self.fits.fit_all(finalists)
        if self.fits.is_far and all(
            criteria.is_far_from_floor(m, self.settings) for m in self._acceptable(models)
        ):
            models += self.fits.on_measured_angle()
        contenders = self._acceptable(models) or self._pairs(finalists)
        chosen = self._choose(contenders)
        if chosen is not None and is_off_rig(chosen.solution):
            contenders += self._pairs_nearer_the_rig(chosen, close)
            chosen = self._choose(contenders)
        near = {s.name for s in finalists}
        trials = [self._far_behind(s) for s in screened if s.name not in near]
        trials += [self._refusal(m, chosen) for m in models if m is not chosen]
        return StepResult(chosen, trials)

    @cached_property
    def fits(self) -> StepFits:
        """The fits beside the current model."""
        return StepFits(self.current, self.effects, self.pools, self.settings, self._say)

    def _acceptable(self, models: Sequence[Candidate]) -> list[Candidate]:
        return [m for m in models if criteria.refusal(m, self.current, self.settings) is None]

    def _choose(self, models: Sequence[Candidate]) -> Candidate | None:
        """Return the model to accept."""
        return criteria.break_tie(models, self.current.validation, self.settings)

    def _finalists(
        self, screened: Sequence[ScreenedEffect], close: Sequence[ScreenedEffect]
    ) -> list[ScreenedEffect]:
        """Return the best on the pieces, and the listed look-alikes of the very best."""
        rule, cost = self.settings.forward, self.fits.on_pieces.cost
        if not close:
            return []
        best, alike = close[0].cost, _look_alikes(close[0].effect, self.effects)
        if self.fits.is_far:
            close = [s for s in close if s.cost < _HOPE * cost] or close[:1]
        first, following = close[: rule.full_fits], close[rule.full_fits : 2 * rule.full_fits]
        near = [s for s in first if s.cost < rule.behind_first * best]
        near += [s for s in following if s.cost < _NEXT * best]
        fitted = {s.name: s for s in close}
        rivals = {s.name: s for s in (*reversed(screened), *close) if s.name in alike}
        rivals = {name: s for name, s in rivals.items() if name not in {n.name for n in near}}
        late = [
            fitted[name] if name in fitted else self.fits.fit_pieces([s])[0] for name, s in rivals.items()
        ]
        return [*near, *(s for s in late if s.cost < rule.behind_first * best)]

    def _pairs(self, firsts: Sequence[ScreenedEffect]) -> list[Candidate]:
        """Return acceptable models with two more effects, for where none helps alone and much is left."""
        if not self.fits.is_far:
            return []
        return self._pairs_beside(firsts, self.fits.with_typical)

    def _pairs_nearer_the_rig(self, chosen: Candidate, close: Sequence[ScreenedEffect]) -> list[Candidate]:
        """Return acceptable models with two more effects, the first of which leaves the rig's values less.

        Where two effects are missing, a third may fit as well alone, but only far from the rig.
        """
        most = 0.5 * self.fits.on_pieces.cost
        away = {s.name: candidate.prior_cost(s.problem, s.theta) for s in close if s.cost < most}
        nearer = [s for s in close if away.get(s.name, math.inf) < 0.5 * chosen.prior_cost]
        nearer.sort(key=lambda s: away[s.name])
        return self._pairs_beside(nearer, lambda s: solve(s.problem, s.theta, iterations=0))

    def _pairs_beside(
        self, firsts: Sequence[ScreenedEffect], with_first: Callable[[ScreenedEffect], Solution]
    ) -> list[Candidate]:
        """Return acceptable models with an effect beside one of the first. with_first: on the pieces."""
        fits = self.fits
        if len(self.current.causes) > 1:  # beside more of them, a pair fits whatever is left
            return []
        pairs: list[ScreenedEffect] = []
        for first in firsts[: _PAIRED]:
            pairs += fits.fit_pieces(fits.screen(with_first(first))[: _PAIRED])
        promising = sorted(
            (p for p in pairs if p.cost < _HOPE_OF_TWO * fits.on_pieces.cost), key=lambda p: p.cost
        )
        return self._acceptable(fits.fit_all(promising[: _PAIR_FITS]))

    def _far_behind(self, screened: ScreenedEffect) -> Trial:
        problem, theta = self.fits.complete(screened)
        return Trial(screened.name, self.current, problem, theta, is_full=False, reason="far_behind")

    def _refusal(self, model: Candidate, chosen: Candidate | None) -> Trial:
        """Return the trial of a model that was not accepted, with the reason."""
        refused = criteria.refusal(model, self.current, self.settings)
        if refused is not None or chosen is None:
            return trial_of(model, model.newest, self.current, refused or "not_sure")
        loss = float(chosen.validation.loss(chosen.validation).sum())
        is_alike = criteria.loss_excess(model, chosen) < _ALIKE * loss
        is_larger = model.parameters > chosen.parameters and is_alike
        reason: Reason = "no_better_than_simpler" if is_larger else "explains_less"
        if criteria.loss_excess(model, chosen) < 0.0 and model.prior_cost > chosen.prior_cost:
            reason = "no_better_than_likelier"
        return trial_of(model, model.newest, self.current, reason, chosen.newest)

    def _say(self, what: str, within: float) -> None:
        """Report the current trial; each step counts as half of the remaining work."""
        share = 1.0 - 0.5**self.number * (1.0 - 0.5 * within)
        self.tell(f"step {self.number + 1}: {what}", share)


def _look_alikes(effect: Effect, effects: Sequence[Effect]) -> set[str]:
    """Return the listed look-alikes of an effect, and those that list it and are no larger."""
    confusable, size = effect.claims.confusable_with, candidate.effect_size(effect.name)
    alike = look_alikes(effect.name, effects)
    return {e.name for e in alike if e.name in confusable or candidate.effect_size(e.name) <= size}


def select_stepwise(
    nominal: Problem, effects: Sequence[Effect], pools: Pools, tell: Progress, settings: DiagnosisSettings,
    start: Rig | None = None,
) -> Selection:  # fmt: skip
    """Select up to max_causes causes among some effects, the one that explains most first.

    start: a rig whose values the first fits begin with, and whose effects, of those tried, come first.
    """
    setup = FitSetup(nominal.cases, settings, pools.run)
    models = [_fit_nominal(nominal, setup, start)]
    known, searched = start or nominal.rig, {e.name: e for e in effects if e.name not in nominal.acting}
    for cause in (e for e in known.effects if e.name in searched):
        last, effect = models[-1], searched[cause.name]
        problem, _ = add_effect(last.problem, last.solution.theta, effect, dict(cause.parameters))
        model = candidate.fit_candidate(setup, problem, vector_of(problem.unknowns, known))
        models.append(candidate.refit(candidate.with_noise_reestimated(model), setup))
    return go_on(Selection(_on_the_last_noise(models)), effects, pools, tell, settings)


def go_on(
    selection: Selection, effects: Sequence[Effect], pools: Pools, tell: Progress, settings: DiagnosisSettings
) -> Selection:  # fmt: skip
    """Return a selection with further causes, up to max_causes; itself but for trials where none helps."""
    models, trials = list(selection.models), list(selection.trials)
    setup = FitSetup(models[0].cases, settings, pools.run)
    while len(models[-1].causes) < settings.max_causes and not _is_finished(models[-1]):
        current = models[-1]
        step = ForwardStep(current, effects, len(current.causes), pools, tell, settings).run()
        trials += step.trials
        if step.accepted is None:
            break
        trials.append(trial_of(step.accepted, step.accepted.newest, current, "replaced"))
        accepted = candidate.with_noise_reestimated(candidate.where_it_begins(step.accepted, setup))
        models.append(candidate.on_fine_steps(candidate.refit(accepted, setup), setup))
    if len(models) == len(selection.models):
        return replace(selection, trials=tuple(trials))
    return Selection(_on_the_last_noise(models), tuple(trials))


def _on_the_last_noise(models: Sequence[Candidate]) -> tuple[Candidate, ...]:
    """Return models scored against the noise that the last of them shows."""
    return (*(candidate.rescore(m, models[-1].cases) for m in models[:-1]), models[-1])


def _fit_nominal(nominal: Problem, setup: FitSetup, start: Rig | None) -> Candidate:
    """Fit the nominal model, and again with the noise that its residual shows.

    A loop's torque is constant over a tick, and so is its residual over a clock: both conventions are starts.
    """
    theta = vector_of(nominal.unknowns, start) if start else None
    longer = replace(setup, iterations=25)
    first = candidate.fit_candidate(longer, nominal, theta)
    own = {u.name: u.doubt for u in nominal.unknowns if u.name == LOOP_CLOCK}
    if own:
        with_own = theta_with(nominal.unknowns, first.solution.theta, own)
        other = candidate.fit_candidate(longer, nominal, with_own)
        first = min(first, other, key=lambda m: m.solution.cost)
    return candidate.refit(candidate.with_noise_reestimated(first), setup)


def _is_finished(model: Candidate) -> bool:
    """Return whether only noise is left; coloured noise may hide a cause that a fit still finds."""
    is_coloured = any(case.coloured for case in model.cases)
    return candidate.leaves_only_noise(model, model.settings.floor.only_noise) and not is_coloured


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
            if (rival.name in fitted | barred or look_alikes(name, [rival]))
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
        if screened is None or not (look_alikes(name, [rival]) or screened.cost < close):
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
