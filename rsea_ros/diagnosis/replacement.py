"""Replacement: a cause's place is offered to the more detailed effects that it is said to be confused with.

What was named first was chosen while the other causes still hid in the residual: a hardening spring stands in
for a stop, Coulomb friction for Stribeck's. Beside the causes that came later the right one does better.
"""

from __future__ import annotations

from dataclasses import replace

from rsea_ros.diagnosis.candidate import FitSetup, effect_size, fit_candidate
from rsea_ros.diagnosis.criteria import is_acceptable, is_far_from_floor
from rsea_ros.diagnosis.forward_step import NO_STEP, ForwardStep, StepResult
from rsea_ros.diagnosis.screening import without_effect
from rsea_ros.effects.catalogue import look_alikes


def replacement_step(step: ForwardStep) -> StepResult:
    """Return the step to a model with another effect in the place of one cause, where it is acceptable."""
    present, settings = step.present, step.settings
    for name in present.causes if is_far_from_floor(present, settings) else ():
        alike = [e for e in look_alikes(name, step.effects) if e.name not in present.problem.acting]
        rivals = [e for e in alike if effect_size(e.name) > effect_size(name)]
        if not rivals:
            continue
        setup = FitSetup(
            present.cases, settings.fits, step.pools.run, weights=present.validation, is_quick=True
        )
        rest = fit_candidate(setup, *without_effect(present.problem, present.solution.theta, name))
        result = replace(step, present=rest, effects=rivals).run()
        if result.accepted is not None and is_acceptable(result.accepted, present, settings):
            return result
    return NO_STEP
