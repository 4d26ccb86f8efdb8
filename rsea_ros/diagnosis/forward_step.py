"""One round of the search: every effect tried beside the present model, at a cost that grows as few remain.

All are screened and the promising fitted on short pieces of the data; the best of those are fitted on all
that may be fitted to.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import NamedTuple

import numpy as np

from rsea_ros.diagnosis.candidate import Model, fitted, heavier, on_places, quicker, refitted
from rsea_ros.diagnosis.criteria import as_well, at_bound, choose, is_far, is_progress, loss_excess
from rsea_ros.diagnosis.data_split import CHOOSE, FIT, score_on
from rsea_ros.diagnosis.initial_guess import Seen, Start, starts_of
from rsea_ros.diagnosis.judge import compare
from rsea_ros.diagnosis.screening import Hypothesis, screen
from rsea_ros.diagnosis.trial import Trial, trial_of
from rsea_ros.diagnosis.windows import windows_of
from rsea_ros.diagnosis.workers import Workers
from rsea_ros.effects.effect import Effect
from rsea_ros.effects.signal_table import ROTOR_ANGLE
from rsea_ros.identification.alternatives import extended
from rsea_ros.identification.problem import Case, Problem
from rsea_ros.identification.solver import Solution, power, solve
from rsea_ros.identification.unknowns import apply
from rsea_ros.progress import Progress
from rsea_ros.signals import FloatArray

_FITS_ON_PIECES = 9
_FULL_FITS = 3
_BEHIND = (4.0, 1.1)
"""Of the best cost on pieces: so close the first effects must be to be fitted to everything, and the next."""
_HOPE = {1: 0.98, 2: 0.9}
"""Of the present cost on pieces, far from the floor: above it, one or two effects cannot be progress."""
_HALF = 0.5
"""Of the present cost on pieces: what leaves more there does not come near the floor."""
_MOVED = 0.02
"""Relative change of what is left of a channel, from which a fit is repeated with that as its weight."""
_PAIRED = 3
_BESIDE_A_PAIR = 1
"""As many causes may be there when two at once are tried: beside more, pairs bend to whatever is left."""
_PRESENT_ITERATIONS = 5
_PIECES_ITERATIONS = 12
_FULL_ITERATIONS = 6


class Played(NamedTuple):
    """The model to accept, if any, all other trials, and the models that do as well as it."""

    accepted: Model | None
    trials: list[Trial]
    equals: tuple[Model, ...]


NOTHING = Played(None, [], ())


@dataclass(frozen=True)
class Round:
    """What a round starts from: every sample of the cases, the effects to try, and the model so far."""

    cases: tuple[Case, ...]
    effects: Sequence[Effect]
    present: Model
    number: int
    at_work: Workers
    tell: Progress

    def play(self) -> Played:
        """Try every effect, where none helps two at once."""
        screened = self._screened(self.on_pieces)
        finalists = self._finalists(screened)
        models = list(self.at_work.fits.map(self._fit_all, finalists))
        better = [m for m in models if is_progress(m, self.present)]
        if not better:
            finalists += self._hopeful(screened, finalists)
            models += self.at_work.fits.map(self._fit_all, finalists[len(models) :])
            better = [m for m in models if is_progress(m, self.present)]
        if is_far(self.present) and all(is_far(m) for m in better):
            models += self._ridden()
            better = [m for m in models if is_progress(m, self.present)]
        if not better and len(self.present.causes) <= _BESIDE_A_PAIR and is_far(self.present):
            better = [m for m in self._pairs(finalists) if is_progress(m, self.present)]
        chosen, equals = choose(better, self.present.choose)
        final = {h.name for h in finalists}
        trials = [self._far_behind(h) for h in screened if h.name not in final]
        trials += [self._trial(m, better, chosen) for m in models if m is not chosen]
        return Played(chosen, trials, equals)

    def _hopeful(self, screened: Sequence[Hypothesis], tried: Sequence[Hypothesis]) -> list[Hypothesis]:
        """Return the effects that were left out but surely help, unfitted, on blocks that took no part.

        The pieces are few: where an effect is small, which of them it shows in is chance.
        """
        names = {h.name for h in tried}
        left_out = [h for h in screened if h.name not in names]
        helps = self.at_work.fits.map(self._surely_helps, left_out)
        return [h for h, is_sure in zip(left_out, helps, strict=True) if is_sure]

    def _surely_helps(self, h: Hypothesis) -> bool:
        """Tell whether an effect as it was fitted to the pieces does better on the blocks that choose."""
        problem, theta = self._with_clocks(h)
        outputs = [problem.outputs(start) for start in self._starts_of_all(theta)]
        scores = [score_on(problem, self.cases, CHOOSE, simulated) for simulated in outputs]
        extra = len(theta) - self.present.parameters
        return any(compare(score, self.present.choose, extra).sure for score in scores)

    def _ridden(self) -> list[Model]:
        """Return models with an effect of the rotor's angle that rides on the measured angle.

        A free simulation, a gear ratio away from the output, may settle in other detents. But the measured
        angle knows what every other cause has done to the motion, so such a model counts only where it leaves
        little: otherwise it bends to whatever else is missing.
        """
        present = self.on_pieces
        riding = replace(present, problem=replace(present.problem, ride=True))
        effects = [e for e in self.effects if ROTOR_ANGLE in e.reads and e.name not in self.present.causes]
        screened = [screen(riding, e, self._starts[e.name]) for e in effects]
        on_pieces = [self._fit_pieces(h) for h in screened if h is not None]
        models = [self._fit_all(h) for h in on_pieces if h.cost < _HALF * present.cost]
        return [m for m in models if not is_far(m)]

    def _pairs(self, firsts: Sequence[Hypothesis]) -> list[Model]:
        """Return models with two more effects, for where none helps alone: each of some with every other."""
        close = []
        for first in firsts[:_PAIRED]:
            seconds = self._screened(self._unfitted(first.effect))[:_PAIRED]
            close += list(self.at_work.fits.map(self._fit_pieces, seconds))
        best = sorted((h for h in close if h.cost < _HOPE[2] * self.on_pieces.cost), key=lambda h: h.cost)
        return list(self.at_work.fits.map(self._fit_all, best[:2]))

    def _unfitted(self, effect: Effect) -> Solution:
        """Return the present model on the pieces with an effect of typical size, as it stands."""
        there = self.on_pieces
        return solve(*extended(there.problem, there.theta, effect, dict(effect.typical)), iterations=0)

    @cached_property
    def on_pieces(self) -> Solution:
        """The present model fitted to short pieces, with clocks taken as right."""
        runs = zip(self.cases, self.present.outputs, strict=True)
        pieces = tuple(heavier(w, self.present.choose) for c, out in runs for w in windows_of(c, out))
        solution = self.present.solution
        problem, theta = without_clocks(replace(solution.problem, cases=pieces), solution.theta)
        problem = quicker(problem) if is_far(self.present) else problem
        return solve(problem, theta, iterations=_PRESENT_ITERATIONS)

    def _screened(self, there: Solution) -> list[Hypothesis]:
        """Return what two cheap steps of every other effect reach beside a solution, best first."""
        acting = {e.name for e in there.problem.rig.effects}
        effects = [e for e in self.effects if e.name not in acting]
        starts = self._starts

        def screen_one(i: int) -> Hypothesis | None:
            self._say(effects[i].name, 0.4 * i / len(effects))
            return screen(there, effects[i], starts[effects[i].name])

        found = [h for h in self.at_work.fits.map(screen_one, range(len(effects))) if h is not None]
        return sorted(found, key=lambda h: h.cost)

    @cached_property
    def _starts(self) -> dict[str, list[Start]]:
        """Where fits of every effect that does not act yet begin."""
        there = self.present.solution
        rig, _ = apply(there.problem.rig, there.problem.unknowns, there.theta)
        effects = [e for e in self.effects if e.name not in self.present.causes]
        seen = Seen(self.cases[0], rig, self.present.outputs[0])
        found = self.at_work.fits.map(lambda e: starts_of(e, seen), effects)
        return {e.name: starts for e, starts in zip(effects, found, strict=True)}

    def _finalists(self, screened: Sequence[Hypothesis]) -> list[Hypothesis]:
        """Return the best on pieces, and what is said to be confused with the very best."""
        worth = [h for h in screened if h.cost < self.on_pieces.cost][:_FITS_ON_PIECES]
        close = sorted(self.at_work.fits.map(self._fit_pieces, worth), key=lambda h: h.cost)
        if not close:
            return []
        best, rivals = close[0].cost, close[0].effect.claims.confusable_with
        if is_far(self.present):
            close = [h for h in close if h.cost < _HOPE[1] * self.on_pieces.cost] or close[:1]
        near = [h for i, h in enumerate(close[: 2 * _FULL_FITS]) if h.cost < _BEHIND[i // _FULL_FITS] * best]
        heard = {h.name for h in near}
        fitted_on_pieces = {h.name for h in close}
        unheard = [h for h in (*close, *screened) if h.name in rivals and h.name not in heard]
        once = {h.name: h for h in reversed(unheard)}.values()
        late = [h if h.name in fitted_on_pieces else self._fit_pieces(h) for h in once]
        return [*near, *(h for h in late if h.cost < _BEHIND[0] * best)]

    def _fit_pieces(self, h: Hypothesis) -> Hypothesis:
        self._say(f"fitting {h.name}", 0.5)
        solution = solve(h.problem, h.theta, iterations=_PIECES_ITERATIONS)
        return replace(h, theta=solution.theta, cost=solution.cost)

    def _fit_all(self, h: Hypothesis) -> Model:
        self._say(f"fitting {h.name} on everything", 0.8)
        weights, run, far = self.present.choose, self.at_work.run, is_far(self.present)
        problem, theta = self._with_clocks(h)
        masked = on_places(problem, self.cases, FIT, weights)
        masked = quicker(masked) if far else masked
        start = min(self._starts_of_all(theta), key=lambda t: power(masked.residual(t)))
        fit = partial(
            fitted, self.cases, iterations=_FULL_ITERATIONS, weights=weights, run=run, quick=far
        )
        first = fit(problem, start)
        if problem.ride:
            free = fit(replace(problem, ride=False), first.solution.theta)
            first = free if as_well(free, first) else first
        return refitted(self.cases, first, run, quick=is_far(first)) if self._has_moved(first) else first

    def _starts_of_all(self, theta: FloatArray) -> list[FloatArray]:
        """Return where a fit to everything may begin: as on the pieces, or as the present model beside that.

        The pieces were fitted without clocks: what these do, other values have taken over there.
        """
        there = self.present.solution
        clocks = sum(u.is_clock for u in there.problem.unknowns)
        own = theta[len(there.theta) - clocks : len(theta) - clocks]
        values, moved = np.split(there.theta, [len(there.theta) - clocks])
        return [theta, np.concatenate([values, own, moved])]

    def _has_moved(self, model: Model) -> bool:
        """Tell whether a model leaves so much more or less of a channel than the present one, its weight."""
        channels = model.choose.sums
        now, before = (
            np.array([max(s.ratio(n), 1.0) for n in channels]) for s in (model.choose, self.present.choose)
        )
        return bool(np.any(np.abs(now / before - 1.0) > _MOVED))

    def _with_clocks(self, h: Hypothesis) -> tuple[Problem, FloatArray]:
        return with_clocks(replace(h.problem, cases=self.cases), h.theta, self.present.solution.problem)

    def _say(self, what: str, within: float) -> None:
        """Tell what is being tried; rounds are taken to halve what is left of the work."""
        share = 1.0 - 0.5**self.number * (1.0 - 0.5 * within)
        self.tell(f"round {self.number + 1}: {what}", share)

    def _far_behind(self, h: Hypothesis) -> Trial:
        why = "far behind the best on the data that it was fitted to"
        return Trial(h.name, self.present, *self._with_clocks(h), is_full=False, why=why)

    def _trial(self, model: Model, better: Sequence[Model], chosen: Model | None) -> Trial:
        return trial_of(model, model.causes[-1], self.present, _why_not(model, better, chosen))


def _why_not(model: Model, better: Sequence[Model], chosen: Model | None) -> str:
    if at_bound(model.solution):
        return "its size ran to the bound of what such an effect has"
    if chosen is None or not any(model is m for m in better):
        return "does not lower the residual of data that it was not fitted to"
    near = loss_excess(model, chosen) < 0.02 * chosen.choose.loss(chosen.choose).sum()
    if model.parameters > chosen.parameters and near:
        return f"no better than {chosen.causes[-1]}, which is simpler"
    return f"{chosen.causes[-1]} explains more"


def without_clocks(problem: Problem, theta: FloatArray) -> tuple[Problem, FloatArray]:
    """Return a problem and its theta with all clocks taken as right.

    Beside a misfit far above the noise the clocks only run to their bounds and lead the search astray.
    """
    keep = [i for i, u in enumerate(problem.unknowns) if not u.is_clock]
    return replace(problem, unknowns=tuple(problem.unknowns[i] for i in keep)), theta[keep]


def with_clocks(problem: Problem, theta: FloatArray, model: Problem) -> tuple[Problem, FloatArray]:
    """Return a problem and its theta with the clocks of another problem free again, at zero."""
    clocks = tuple(u for u in model.unknowns if u.is_clock)
    larger = replace(problem, unknowns=(*problem.unknowns, *clocks))
    return larger, np.concatenate([theta, np.zeros(len(clocks))])
