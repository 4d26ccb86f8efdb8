"""The search: from the re-fitted nominal model, cause after cause, to the noise floor or until nothing helps.

A model is fitted on FIT blocks and chosen on CHOOSE blocks; JUDGE blocks are not looked at here.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from rsea_ros.diagnosis.candidate import Model, at_floor, fitted, reestimated, refitted, rescored
from rsea_ros.diagnosis.exchange import exchanged
from rsea_ros.diagnosis.forward_step import NOTHING, Round
from rsea_ros.diagnosis.trial import Trial, trial_of
from rsea_ros.diagnosis.workers import Workers
from rsea_ros.effects.effect import Effect
from rsea_ros.identification.problem import Case, Problem
from rsea_ros.progress import Progress

_FIRST_ITERATIONS = 25
_MOST_EXCHANGES = 2
GAVE_WAY = "another took its place beside the causes that came later"
"""Why a cause that was accepted is none in the end, if nothing else says so."""


@dataclass(frozen=True)
class Search:
    """All cases (every sample), the accepted models from the nominal one on, and what else was tried.

    rivals: by accepted cause, the models that do as well with another in its place.
    """

    cases: tuple[Case, ...]
    models: tuple[Model, ...]
    trials: tuple[Trial, ...] = ()
    rivals: Mapping[str, tuple[Model, ...]] = field(default_factory=dict)

    def rivals_of(self, cause: str) -> tuple[Model, ...]:
        """Return the models that do as well with another in a cause's place, which is no cause beside it."""
        return tuple(m for m in self.rivals.get(cause, ()) if m.causes[-1] not in self.last.causes)

    @property
    def last(self) -> Model:
        """The model with all accepted causes."""
        return self.models[-1]


def search(
    cases: tuple[Case, ...],
    nominal: Problem,
    effects: Sequence[Effect],
    at_work: Workers,
    tell: Progress,
    max_causes: int,
) -> Search:
    """Find up to max_causes causes among some effects, most telling first."""
    models = [fitted(cases, nominal, None, iterations=_FIRST_ITERATIONS, run=at_work.run)]
    cases = reestimated(cases, models[0])
    models = [refitted(cases, models[0], at_work.run)]
    trials: list[Trial] = []
    equals: dict[str, tuple[Model, ...]] = {}
    for number in range(max_causes + _MOST_EXCHANGES):
        present, played = models[-1], NOTHING
        if at_floor(present, cases) and not any(c.coloured for c in cases):
            break  # coloured noise may hide a cause that a fit still finds
        if len(present.causes) < max_causes:
            played = Round(cases, effects, present, number, at_work, tell).play()
            trials += played.trials
        if played.accepted is None:
            played = exchanged(cases, effects, present, number, at_work, tell)
        accepted = played.accepted
        if accepted is None:
            break
        equals[accepted.causes[-1]] = played.equals
        trials.append(trial_of(accepted, accepted.causes[-1], present, GAVE_WAY))
        quieter = reestimated(cases, accepted)
        accepted = refitted(quieter, accepted, at_work.run)
        models = [*(rescored(quieter, m) for m in models), accepted]
        cases = quieter
    return Search(cases, tuple(models), tuple(trials), equals)
