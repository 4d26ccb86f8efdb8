"""Exchange: a cause's place is offered to the more detailed effects that it is said to be confused with.

What was named first was chosen while the other causes still hid in the residual: a hardening spring stands in
for a stop, Coulomb friction for Stribeck's. Beside the causes that came later the right one does better.
"""

from __future__ import annotations

from collections.abc import Sequence

from rsea_ros.diagnosis.candidate import Candidate, effect_size, fit_candidate
from rsea_ros.diagnosis.criteria import is_acceptable, is_far_from_floor
from rsea_ros.diagnosis.forward_step import NO_STEP, ForwardStep, StepResult
from rsea_ros.diagnosis.screening import without_effect
from rsea_ros.effects.catalogue import look_alikes
from rsea_ros.effects.effect import Effect
from rsea_ros.identification.problem import Case
from rsea_ros.identification.workers import Pools
from rsea_ros.progress import Progress


def replacement_step(
    cases: tuple[Case, ...],
    effects: Sequence[Effect],
    present: Candidate,
    number: int,
    pools: Pools,
    tell: Progress,
) -> StepResult:
    """Return a model with another effect in the place of one cause that is progress, as a round does."""
    for name in present.causes if is_far_from_floor(present) else ():
        alike = [e for e in look_alikes(name, effects) if e.name not in present.solution.problem.acting]
        rivals = [e for e in alike if effect_size(e.name) > effect_size(name)]
        if rivals:
            there = present.solution
            rest = fit_candidate(
                cases,
                *without_effect(there.problem, there.theta, name),
                weights=present.validation,
                run=pools.run,
                quick=True,
            )
            played = ForwardStep(cases, rivals, rest, number, pools, tell).run()
            if played.accepted is not None and is_acceptable(played.accepted, present):
                return played
    return NO_STEP
