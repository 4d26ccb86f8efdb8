"""Stepwise selection: from the re-fitted nominal model, cause after cause, until no effect helps any more.

All are screened and the promising fitted on short pieces of the data; the best of those are fitted to all
training blocks. Where none is acceptable, effects on the measured rotor angle are tried, then two at once.
Two at once are also tried where the best fits only far from the rig.

Models are fitted to the training blocks and chosen on the validation blocks; the test blocks are not touched.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

from rsea_ros.diagnosis import candidate, criteria
from rsea_ros.diagnosis.candidate import Candidate, FitSetup
from rsea_ros.diagnosis.evaluation import Selection, Trial, trial_of
from rsea_ros.diagnosis.result import Reason
from rsea_ros.diagnosis.settings import DiagnosisSettings
from rsea_ros.diagnosis.step_fits import ScreenedEffect, StepFits
from rsea_ros.effects.catalogue import look_alikes
from rsea_ros.effects.effect import Effect
from rsea_ros.identification.confidence import is_off_rig
from rsea_ros.identification.problem import Problem
from rsea_ros.identification.solver import Pools, Solution, solve
from rsea_ros.identification.unknowns import LOOP_CLOCK, theta_with, vector_of
from rsea_ros.model.rig import Rig
from rsea_ros.progress import Progress

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

    start: a rig whose values the first fit begins with.
    """
    fitted = _fit_nominal(nominal, FitSetup(nominal.cases, settings, pools.run), start)
    return go_on(Selection((fitted,)), effects, pools, tell, settings)


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
    cases = models[-1].cases
    return Selection((*(candidate.rescore(m, cases) for m in models[:-1]), models[-1]), tuple(trials))


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
