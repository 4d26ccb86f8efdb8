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

from rsea_ros.diagnosis.candidate import (
    Candidate,
    fit_candidate,
    on_blocks,
    refit,
    with_doubled_step,
    with_misfit_as_noise,
)
from rsea_ros.diagnosis.criteria import (
    break_tie,
    is_acceptable,
    is_equally_good,
    is_far_from_floor,
    loss_excess,
    refusal,
)
from rsea_ros.diagnosis.data_split import TRAIN, VALIDATION, score_on
from rsea_ros.diagnosis.initial_guess import InitialGuess, ResidualView, initial_guesses
from rsea_ros.diagnosis.judge import preference
from rsea_ros.diagnosis.screening import ScreenedEffect, screen
from rsea_ros.diagnosis.short_pieces import short_pieces_of
from rsea_ros.diagnosis.trial import Trial, trial_of
from rsea_ros.effects.effect import Effect
from rsea_ros.effects.signal_table import ROTOR_ANGLE
from rsea_ros.identification.alternatives import extended
from rsea_ros.identification.problem import Case, Problem
from rsea_ros.identification.solver import Solution, power, solve
from rsea_ros.identification.unknowns import apply
from rsea_ros.identification.workers import Pools
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


class StepResult(NamedTuple):
    """The model to accept, if any, all other trials, and the models that do as well as it."""

    accepted: Candidate | None
    trials: list[Trial]
    equals: tuple[Candidate, ...]


NO_STEP = StepResult(None, [], ())


@dataclass(frozen=True)
class ForwardStep:
    """What a round starts from: every sample of the cases, the effects to try, and the model so far."""

    cases: tuple[Case, ...]
    effects: Sequence[Effect]
    present: Candidate
    number: int
    pools: Pools
    tell: Progress

    def run(self) -> StepResult:
        """Try every effect, where none helps two at once."""
        screened = self._screened(self.on_pieces)
        finalists = self._finalists(screened)
        models = list(self.pools.fits.map(self._fit_all, finalists))
        better = [m for m in models if is_acceptable(m, self.present)]
        if not better:
            finalists += self._hopeful(screened, finalists)
            models += self.pools.fits.map(self._fit_all, finalists[len(models) :])
            better = [m for m in models if is_acceptable(m, self.present)]
        if is_far_from_floor(self.present) and all(is_far_from_floor(m) for m in better):
            models += self._ridden()
            better = [m for m in models if is_acceptable(m, self.present)]
        if not better and len(self.present.causes) <= _BESIDE_A_PAIR and is_far_from_floor(self.present):
            better = [m for m in self._pairs(finalists) if is_acceptable(m, self.present)]
        chosen, equals = break_tie(better, self.present.validation)
        final = {h.name for h in finalists}
        trials = [self._far_behind(h) for h in screened if h.name not in final]
        trials += [self._trial(m, chosen) for m in models if m is not chosen]
        return StepResult(chosen, trials, equals)

    def _hopeful(
        self, screened: Sequence[ScreenedEffect], tried: Sequence[ScreenedEffect]
    ) -> list[ScreenedEffect]:
        """Return the effects that were left out but surely help, unfitted, on blocks that took no part.

        The pieces are few: where an effect is small, which of them it shows in is chance.
        """
        names = {h.name for h in tried}
        left_out = [h for h in screened if h.name not in names]
        helps = self.pools.fits.map(self._surely_helps, left_out)
        return [h for h, is_sure in zip(left_out, helps, strict=True) if is_sure]

    def _surely_helps(self, h: ScreenedEffect) -> bool:
        """Tell whether an effect as it was fitted to the pieces does better on the blocks that choose."""
        problem, theta = self._with_clocks(h)
        outputs = [problem.outputs(start) for start in self._starts_of_all(theta)]
        scores = [score_on(problem, self.cases, VALIDATION, simulated) for simulated in outputs]
        extra = len(theta) - self.present.parameters
        return any(preference(score, self.present.validation, extra).sure for score in scores)

    def _ridden(self) -> list[Candidate]:
        """Return models with an effect of the rotor's angle that rides on the measured angle.

        A free simulation, a gear ratio away from the output, may settle in other detents. But the measured
        angle knows what every other cause has done to the motion, so such a model counts only where it leaves
        little: otherwise it bends to whatever else is missing.
        """
        present = self.on_pieces
        riding = replace(present, problem=replace(present.problem, ride=True))
        acting = self.present.solution.problem.acting
        effects = [e for e in self.effects if ROTOR_ANGLE in e.reads and e.name not in acting]
        screened = [screen(riding, e, self._starts[e.name]) for e in effects]
        on_pieces = [self._fit_pieces(h) for h in screened if h is not None]
        models = [self._fit_all(h) for h in on_pieces if h.cost < _HALF * present.cost]
        return [m for m in models if not is_far_from_floor(m)]

    def _pairs(self, firsts: Sequence[ScreenedEffect]) -> list[Candidate]:
        """Return models with two more effects, for where none helps alone: each of some with every other."""
        close = []
        for first in firsts[:_PAIRED]:
            seconds = self._screened(self._unfitted(first.effect))[:_PAIRED]
            close += list(self.pools.fits.map(self._fit_pieces, seconds))
        best = sorted((h for h in close if h.cost < _HOPE[2] * self.on_pieces.cost), key=lambda h: h.cost)
        return list(self.pools.fits.map(self._fit_all, best[:2]))

    def _unfitted(self, effect: Effect) -> Solution:
        """Return the present model on the pieces with an effect of typical size, as it stands."""
        there = self.on_pieces
        return solve(*extended(there.problem, there.theta, effect, dict(effect.typical)), iterations=0)

    @cached_property
    def on_pieces(self) -> Solution:
        """The present model fitted to short pieces, with clocks taken as right."""
        runs = zip(self.cases, self.present.outputs, strict=True)
        pieces = tuple(
            with_misfit_as_noise(w, self.present.validation)
            for c, out in runs
            for w in short_pieces_of(c, out)
        )
        solution = self.present.solution
        problem, theta = without_clocks(replace(solution.problem, cases=pieces), solution.theta)
        problem = with_doubled_step(problem) if is_far_from_floor(self.present) else problem
        return solve(problem, theta, iterations=_PRESENT_ITERATIONS)

    def _screened(self, there: Solution) -> list[ScreenedEffect]:
        """Return what two cheap steps of every other effect reach beside a solution, best first."""
        effects = [e for e in self.effects if e.name not in there.problem.acting]
        starts = self._starts

        def screen_one(i: int) -> ScreenedEffect | None:
            self._say(effects[i].name, 0.4 * i / len(effects))
            return screen(there, effects[i], starts[effects[i].name])

        found = [h for h in self.pools.fits.map(screen_one, range(len(effects))) if h is not None]
        return sorted(found, key=lambda h: h.cost)

    @cached_property
    def _starts(self) -> dict[str, list[InitialGuess]]:
        """Where fits of every effect that does not act yet begin."""
        there = self.present.solution
        rig, _ = apply(there.problem.rig, there.problem.unknowns, there.theta)
        effects = [e for e in self.effects if e.name not in there.problem.acting]
        seen = ResidualView(self.cases[0], rig, self.present.outputs[0])
        found = self.pools.fits.map(lambda e: initial_guesses(e, seen), effects)
        return {e.name: starts for e, starts in zip(effects, found, strict=True)}

    def _finalists(self, screened: Sequence[ScreenedEffect]) -> list[ScreenedEffect]:
        """Return the best on pieces, and what is said to be confused with the very best."""
        worth = [h for h in screened if h.cost < self.on_pieces.cost][:_FITS_ON_PIECES]
        close = sorted(self.pools.fits.map(self._fit_pieces, worth), key=lambda h: h.cost)
        if not close:
            return []
        best, rivals = close[0].cost, close[0].effect.claims.confusable_with
        if is_far_from_floor(self.present):
            close = [h for h in close if h.cost < _HOPE[1] * self.on_pieces.cost] or close[:1]
        near = [h for i, h in enumerate(close[: 2 * _FULL_FITS]) if h.cost < _BEHIND[i // _FULL_FITS] * best]
        heard = {h.name for h in near}
        fitted_on_pieces = {h.name for h in close}
        unheard = [h for h in (*close, *screened) if h.name in rivals and h.name not in heard]
        once = {h.name: h for h in reversed(unheard)}.values()
        late = [h if h.name in fitted_on_pieces else self._fit_pieces(h) for h in once]
        return [*near, *(h for h in late if h.cost < _BEHIND[0] * best)]

    def _fit_pieces(self, h: ScreenedEffect) -> ScreenedEffect:
        self._say(f"fitting {h.name}", 0.5)
        solution = solve(h.problem, h.theta, iterations=_PIECES_ITERATIONS)
        return replace(h, theta=solution.theta, cost=solution.cost)

    def _fit_all(self, h: ScreenedEffect) -> Candidate:
        self._say(f"fitting {h.name} on everything", 0.8)
        weights, run, far = self.present.validation, self.pools.run, is_far_from_floor(self.present)
        problem, theta = self._with_clocks(h)
        masked = on_blocks(problem, self.cases, TRAIN, weights)
        masked = with_doubled_step(masked) if far else masked
        start = min(self._starts_of_all(theta), key=lambda t: power(masked.residual(t)))
        fit = partial(
            fit_candidate, self.cases, iterations=_FULL_ITERATIONS, weights=weights, run=run, quick=far
        )
        first = fit(problem, start)
        if problem.ride:
            free = fit(replace(problem, ride=False), first.solution.theta)
            first = free if is_equally_good(free, first) else first
        return (
            refit(self.cases, first, run, quick=is_far_from_floor(first)) if self._has_moved(first) else first
        )

    def _starts_of_all(self, theta: FloatArray) -> list[FloatArray]:
        """Return where a fit to everything may begin: as on the pieces, or as the present model beside that.

        The pieces were fitted without clocks: what these do, other values have taken over there.
        """
        there = self.present.solution
        clocks = sum(u.is_clock for u in there.problem.unknowns)
        own = theta[len(there.theta) - clocks : len(theta) - clocks]
        values, moved = np.split(there.theta, [len(there.theta) - clocks])
        return [theta, np.concatenate([values, own, moved])]

    def _has_moved(self, model: Candidate) -> bool:
        """Tell whether a model leaves so much more or less of a channel than the present one, its weight."""
        channels = model.validation.sums
        now, before = (
            np.array([max(s.ratio(n), 1.0) for n in channels])
            for s in (model.validation, self.present.validation)
        )
        return bool(np.any(np.abs(now / before - 1.0) > _MOVED))

    def _with_clocks(self, h: ScreenedEffect) -> tuple[Problem, FloatArray]:
        return with_clocks(replace(h.problem, cases=self.cases), h.theta, self.present.solution.problem)

    def _say(self, what: str, within: float) -> None:
        """Tell what is being tried; rounds are taken to halve what is left of the work."""
        share = 1.0 - 0.5**self.number * (1.0 - 0.5 * within)
        self.tell(f"round {self.number + 1}: {what}", share)

    def _far_behind(self, h: ScreenedEffect) -> Trial:
        return Trial(h.name, self.present, *self._with_clocks(h), is_full=False, reason="far_behind")

    def _trial(self, model: Candidate, chosen: Candidate | None) -> Trial:
        reason = refusal(model, self.present)
        if reason is not None or chosen is None:
            return trial_of(model, model.causes[-1], self.present, reason or "not_sure")
        near = loss_excess(model, chosen) < 0.02 * chosen.validation.loss(chosen.validation).sum()
        is_larger = model.parameters > chosen.parameters and near
        reason = "no_better_than_simpler" if is_larger else "explains_less"
        return trial_of(model, model.causes[-1], self.present, reason, chosen.causes[-1])


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
