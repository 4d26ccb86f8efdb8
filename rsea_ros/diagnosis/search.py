"""The search: from the re-fitted nominal model, cause after cause, to the noise floor or until nothing helps.

A model is fitted on FIT blocks and chosen on CHOOSE blocks; JUDGE blocks are not looked at here.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace

import numpy as np

from rsea_ros.diagnosis.hints import starts_of
from rsea_ros.diagnosis.hypothesise import Hypothesis, extended_problem, screen
from rsea_ros.diagnosis.judge import compare
from rsea_ros.diagnosis.split import CHOOSE, FIT, Score, part, score
from rsea_ros.diagnosis.windows import windows_of
from rsea_ros.effects.catalogue import catalogue, effect_named
from rsea_ros.identification.noise import residual_floor
from rsea_ros.identification.problem import Case, Problem
from rsea_ros.identification.solver import Solution, linearised, solve
from rsea_ros.identification.unknowns import CLOCK, Unknown, start_vector
from rsea_ros.signals import FloatArray

AT_FLOOR = 1.04
"""RMS of the residual over the noise, in every channel, below which there is nothing left to explain."""
_FITS_ON_PIECES = 9
_FULL_FITS = 3
_CLOSE = 1.1
_FIT_ITERATIONS = 12
_FULL_ITERATIONS = 6
MOST_CAUSES = 4
ENOUGH = 0.1
"""Relative fall of a channel's residual that makes an effect a cause where the floor is not reached."""
DELAY = "command_delay.delay"

Tell = Callable[[str, float], None]


@dataclass(frozen=True)
class Model:
    """A fitted model, its simulated channels on every case, and how it does on the blocks that choose."""

    solution: Solution
    outputs: list[dict[str, FloatArray]]
    choose: Score

    @property
    def causes(self) -> tuple[str, ...]:
        """Names of the effects that act, in the order in which they came in."""
        return tuple(e.name for e in self.solution.problem.rig.effects)

    @property
    def parameters(self) -> int:
        """How many unknowns the model has."""
        return len(self.solution.theta)


@dataclass(frozen=True)
class Trial:
    """One effect tried in one round beside a model: what became of it."""

    name: str
    round: int
    model: Model | None
    why: str


@dataclass(frozen=True)
class Search:
    """All cases (every sample), the accepted models from the nominal one on, and what else was tried."""

    cases: tuple[Case, ...]
    models: tuple[Model, ...]
    trials: tuple[Trial, ...] = ()
    rivals: Mapping[str, tuple[Model, ...]] = field(default_factory=dict)

    @property
    def last(self) -> Model:
        """The model with all accepted causes."""
        return self.models[-1]


def fitted(
    cases: Sequence[Case],
    problem: Problem,
    theta: FloatArray | None,
    places: tuple[int, ...] = FIT,
    iterations: int = _FIT_ITERATIONS,
    weights: Score | None = None,
) -> Model:
    """Fit a problem's unknowns on some blocks of the cases. weights: a score whose misfit counts as noise."""
    masked = replace(problem, cases=tuple(heavier(part(c, places), weights) for c in cases))
    solution = solve(masked, theta, iterations=iterations)
    moved = with_common_clock_in_delay(solution)
    if moved is not None:
        again = solve(masked, moved, iterations=iterations)
        solution = min(solution, again, key=lambda s: s.cost)
    return as_model(cases, solution)


def with_common_clock_in_delay(solution: Solution) -> FloatArray | None:
    """Return theta with the clock error that all sensors share turned into delay of the command.

    Where a delay is a whole number of samples the residual has a kink, and a fit may stop there with the
    rest in the clocks. None for a model without a delay.
    """
    names = [u.name for u in solution.problem.unknowns]
    clocks = [i for i, n in enumerate(names) if n.startswith(CLOCK + ".")]
    if DELAY not in names or not clocks:
        return None
    theta = solution.theta.copy()
    common = float(np.mean(theta[clocks]))
    theta[clocks] -= common
    theta[names.index(DELAY)] -= common
    return np.asarray(theta)


def heavier(case: Case, weights: Score | None) -> Case:
    """Return a case in which what a model leaves of a channel counts as its noise, where that is more."""
    if weights is None:
        return case
    noise = {n: s * max(1.0, weights.ratio(n)) if n in weights.sums else s for n, s in case.noise.items()}
    return replace(case, noise=noise)


def as_model(cases: Sequence[Case], solution: Solution) -> Model:
    """Return a solution with its outputs and its score on the blocks that choose."""
    outputs = solution.problem.outputs(solution.theta)
    return Model(solution, outputs, score(solution.problem, tuple(part(c, CHOOSE) for c in cases), outputs))


def search(cases: tuple[Case, ...], nominal: Problem, pool: Executor, tell: Tell) -> Search:
    """Find the causes, most telling first. tell: progress (what is being tried, share done)."""
    models = [fitted(cases, nominal, None, iterations=25)]
    cases = requieted(cases, models[0])
    models = [refitted(cases, models[0])]
    trials: list[Trial] = []
    equals: dict[str, tuple[Model, ...]] = {}
    for number in range(MOST_CAUSES):
        if at_floor(models[-1], cases):
            break
        accepted, tried, rivals = one_round(cases, models[-1], number, pool, tell)
        trials += tried
        if accepted is None:
            break
        equals[accepted.causes[-1]] = rivals
        quieter = requieted(cases, accepted)
        accepted = refitted(quieter, accepted)
        models = [*(rescored(quieter, m) for m in models), accepted]
        cases = quieter
    tell("looking for a simpler model", 0.9)
    return sequenced(with_simpler(without_needless(Search(cases, tuple(models), tuple(trials), equals))))


def refitted(cases: Sequence[Case], model: Model) -> Model:
    """Fit a model again with each channel in units of what the model leaves of it."""
    return fitted(cases, model.solution.problem, model.solution.theta, weights=rescored(cases, model).choose)


def at_floor(model: Model, cases: Sequence[Case]) -> bool:
    """Tell whether the residual of every channel is at its noise, on all blocks but those that judge."""
    standing = score(model.solution.problem, tuple(part(c, (*FIT, *CHOOSE)) for c in cases), model.outputs)
    return all(standing.ratio(n) < AT_FLOOR for n in standing.sums)


def one_round(
    cases: tuple[Case, ...], present: Model, number: int, pool: Executor, tell: Tell
) -> tuple[Model | None, list[Trial], tuple[Model, ...]]:
    """Try every effect that is not in the model; return the one to accept, all trials, and its equal rivals.

    All are screened and the promising fitted on short pieces; the best of those are fitted on all that fits.
    """
    effects = [e for n, e in catalogue().items() if n not in present.causes]
    rig, outputs = present.solution.problem.rig, present.outputs[0]
    pieces = tuple(heavier(w, present.choose) for c in cases for w in windows_of(c))
    there = linearised(
        *without_clocks(replace(present.solution.problem, cases=pieces), present.solution.theta)
    )

    def try_one(i: int) -> Hypothesis | None:
        tell(f"round {number + 1}: {effects[i].name}", _share(number, 0.4 * i / len(effects)))
        return screen(there, effects[i], starts_of(effects[i], cases[0], rig, outputs))

    def fit_pieces(h: Hypothesis) -> Hypothesis:
        tell(f"round {number + 1}: fitting {h.name}", _share(number, 0.5))
        solution = solve(h.problem, h.theta, iterations=_FIT_ITERATIONS)
        return replace(h, theta=solution.theta, cost=solution.cost)

    def fit_all(h: Hypothesis) -> Model:
        tell(f"round {number + 1}: fitting {h.name} on everything", _share(number, 0.8))
        problem, theta = with_clocks(replace(h.problem, cases=cases), h.theta, present.solution.problem)
        first = fitted(cases, problem, theta, iterations=_FULL_ITERATIONS, weights=present.choose)
        return refitted(cases, first)

    screened = sorted(
        (h for h in pool.map(try_one, range(len(effects))) if h is not None), key=lambda h: h.cost
    )
    worth = [h for h in screened if h.cost < there.cost][:_FITS_ON_PIECES]
    close = sorted(pool.map(fit_pieces, worth), key=lambda h: h.cost)
    rivals = close[0].effect.claims.confusable_with if close else ()
    unheard = [h for h in screened if h.name in rivals and not any(h.name == w.name for w in close)]
    unheard = [*unheard, *(h for h in close[_FULL_FITS:] if h.name in rivals)]
    finalists = [h for i, h in enumerate(close) if i < _FULL_FITS or h.cost < _CLOSE * close[0].cost][
        : 2 * _FULL_FITS
    ]
    heard = {h.name for h in finalists}
    finalists += [h for h in pool.map(fit_pieces, unheard) if h.name not in heard]
    models = list(pool.map(fit_all, finalists))
    better = [m for m in models if is_progress(m, present)]
    chosen, equals = choose(better, present.choose)
    accepted, final = {id(m) for m in better}, {h.name for h in finalists}
    trials = [
        Trial(h.name, number, None, "far behind the best on the data that it was fitted to")
        for h in screened
        if h.name not in final
    ]
    trials += [_trial(m, number, id(m) in accepted, chosen) for m in models if m is not chosen]
    return chosen, trials, equals


def without_clocks(problem: Problem, theta: FloatArray) -> tuple[Problem, FloatArray]:
    """Return a problem and its theta with all clocks taken as right.

    Beside a misfit far above the noise the clocks only run to their bounds and lead the search astray.
    """
    keep = [i for i, u in enumerate(problem.unknowns) if not u.name.startswith(CLOCK + ".")]
    return replace(problem, unknowns=tuple(problem.unknowns[i] for i in keep)), theta[keep]


def with_clocks(problem: Problem, theta: FloatArray, model: Problem) -> tuple[Problem, FloatArray]:
    """Return a problem and its theta with the clocks of another problem free again, at zero."""
    clocks = tuple(u for u in model.unknowns if u.name.startswith(CLOCK + "."))
    return replace(problem, unknowns=(*problem.unknowns, *clocks)), np.concatenate(
        [theta, np.zeros(len(clocks))]
    )


def _share(number: int, within: float) -> float:
    """Return the share done for the progress bar: rounds are taken to halve what is left."""
    return 1.0 - 0.5**number * (1.0 - 0.5 * within)


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


def requieted(cases: Sequence[Case], model: Model) -> tuple[Case, ...]:
    """Return the cases with the noise lowered where a model's residual shows that it is less."""
    return tuple(
        _requieted(c, out, model.solution.problem) for c, out in zip(cases, model.outputs, strict=True)
    )


def _requieted(case: Case, out: Mapping[str, FloatArray], problem: Problem) -> Case:
    noise = dict(case.noise)
    for n in case.measured:
        if n in out:
            residual = np.where(case.mask[n], case.measured[n] - out[n], 0.0)
            quantum = problem.rig.sensors[n].quantum if n in problem.rig.sensors else 0.0
            floor = max(residual_floor(residual), 0.5 * quantum)
            noise[n] = min(noise[n], floor)
    return replace(case, noise=noise)


def rescored(cases: Sequence[Case], model: Model) -> Model:
    """Return the model with its score against the cases' present noise."""
    problem = replace(model.solution.problem, cases=tuple(part(c, FIT) for c in cases))
    return Model(
        replace(model.solution, problem=problem),
        model.outputs,
        score(problem, tuple(part(c, CHOOSE) for c in cases), model.outputs),
    )


def without_needless(found: Search) -> Search:
    """Take out every accepted cause without which the others do as well."""
    last = found.last
    for name in last.causes[:-1]:
        smaller = _changed(found.cases, last, name)
        if not compare(last.choose, smaller.choose, last.parameters - smaller.parameters).better:
            why = "no longer needed once the other causes are in"
            return without_needless(_replaced(found, smaller, Trial(name, MOST_CAUSES, None, why)))
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
                why = f"no better than {rival}, which is simpler"
                return with_simpler(_replaced(found, simpler, Trial(name, MOST_CAUSES, last, why)))
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


def _trial(model: Model, number: int, was_better: bool, chosen: Model | None) -> Trial:
    name = model.causes[-1]
    if chosen is None or not was_better:
        return Trial(name, number, model, "does not lower the residual of data that it was not fitted to")
    if (
        model.parameters > chosen.parameters
        and loss_excess(model, chosen) < 0.02 * chosen.choose.loss(chosen.choose).sum()
    ):
        return Trial(name, number, model, f"no better than {chosen.causes[-1]}, which is simpler")
    return Trial(name, number, model, f"{chosen.causes[-1]} explains more")
