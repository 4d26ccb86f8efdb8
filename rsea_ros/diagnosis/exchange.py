"""Exchange: a cause's place is offered to the more detailed effects that it is said to be confused with.

What was named first was chosen while the other causes still hid in the residual: a hardening spring stands in
for a stop, Coulomb friction for Stribeck's. Beside the causes that came later the right one does better.
"""

from __future__ import annotations

from collections.abc import Sequence

from rsea_ros.diagnosis.candidate import Model, effect_size, fitted
from rsea_ros.diagnosis.criteria import is_far, is_progress
from rsea_ros.diagnosis.forward_step import NOTHING, Played, Round
from rsea_ros.diagnosis.screening import reduced
from rsea_ros.diagnosis.workers import Workers
from rsea_ros.effects.catalogue import look_alikes
from rsea_ros.effects.effect import Effect
from rsea_ros.identification.problem import Case
from rsea_ros.progress import Progress


def exchanged(
    cases: tuple[Case, ...],
    effects: Sequence[Effect],
    present: Model,
    number: int,
    at_work: Workers,
    tell: Progress,
) -> Played:
    """Return a model with another effect in the place of one cause that is progress, as a round does."""
    for name in present.causes if is_far(present) else ():
        alike = [e for e in look_alikes(name, effects) if e.name not in present.causes]
        rivals = [e for e in alike if effect_size(e.name) > effect_size(name)]
        if rivals:
            there = present.solution
            rest = fitted(
                cases,
                *reduced(there.problem, there.theta, name),
                weights=present.choose,
                run=at_work.run,
                quick=True,
            )
            played = Round(cases, rivals, rest, number, at_work, tell).play()
            if played.accepted is not None and is_progress(played.accepted, present):
                return played
    return NOTHING
