"""The search: from the re-fitted nominal model, cause after cause, to the noise floor or until nothing helps.

A model is fitted on TRAIN blocks and chosen on VALIDATION blocks; TEST blocks are not looked at here.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from rsea_ros.diagnosis.candidate import (
    Candidate,
    cases_with_noise_of,
    fit_candidate,
    leaves_only_noise,
    refit,
    score_again,
)
from rsea_ros.diagnosis.forward_step import NO_STEP, ForwardStep
from rsea_ros.diagnosis.replacement import replacement_step
from rsea_ros.diagnosis.trial import Trial
from rsea_ros.effects.effect import Effect
from rsea_ros.identification.problem import Case, Problem
from rsea_ros.identification.workers import Pools
from rsea_ros.progress import Progress

_FIRST_ITERATIONS = 25
_MOST_EXCHANGES = 2


@dataclass(frozen=True)
class Selection:
    """All cases (every sample), the accepted models from the nominal one on, and what else was tried.

    rivals: by accepted cause, the models that do as well with another in its place.
    """

    cases: tuple[Case, ...]
    models: tuple[Candidate, ...]
    trials: tuple[Trial, ...] = ()
    rivals: Mapping[str, tuple[Candidate, ...]] = field(default_factory=dict)

    def rivals_of(self, cause: str) -> tuple[Candidate, ...]:
        """Return the models that do as well with another in a cause's place, which is no cause beside it."""
        return tuple(m for m in self.rivals.get(cause, ()) if m.causes[-1] not in self.last.causes)

    @property
    def last(self) -> Candidate:
        """The model with all accepted causes."""
        return self.models[-1]


def select_stepwise(
    cases: tuple[Case, ...],
    nominal: Problem,
    effects: Sequence[Effect],
    pools: Pools,
    tell: Progress,
    max_causes: int,
) -> Selection:
    """Find up to max_causes causes among some effects, most telling first."""
    models = [fit_candidate(cases, nominal, None, iterations=_FIRST_ITERATIONS, run=pools.run)]
    cases = cases_with_noise_of(cases, models[0])
    models = [refit(cases, models[0], pools.run)]
    trials: list[Trial] = []
    equals: dict[str, tuple[Candidate, ...]] = {}
    for number in range(max_causes + _MOST_EXCHANGES):
        present, played = models[-1], NO_STEP
        if leaves_only_noise(present, cases) and not any(c.coloured for c in cases):
            break  # coloured noise may hide a cause that a fit still finds
        if len(present.causes) < max_causes:
            played = ForwardStep(cases, effects, present, number, pools, tell).run()
            trials += played.trials
        if played.accepted is None:
            played = replacement_step(cases, effects, present, number, pools, tell)
        accepted = played.accepted
        if accepted is None:
            break
        equals[accepted.causes[-1]] = played.equals
        quieter = cases_with_noise_of(cases, accepted)
        accepted = refit(quieter, accepted, pools.run)
        models = [*(score_again(quieter, m) for m in models), accepted]
        cases = quieter
    return Selection(cases, tuple(models), tuple(trials), equals)
