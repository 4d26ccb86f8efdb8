"""The prior of a cause: it may be zero, and its usual size."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from rsea_ros.effects.catalogue import effect_named
from rsea_ros.effects.effect import Parameter
from rsea_ros.experiment.containment import NOTHING
from rsea_ros.identification.fit import unknowns_of
from rsea_ros.identification.problem import Case, Problem
from rsea_ros.identification.unknowns import Unknown, idle, unknowns_of_effect
from rsea_ros.model.rig import EffectSetting, Rig
from rsea_ros.records.record import MEASURED, FloatArray

_SIZES = 1.0
"""One sigma of the size of a cause around none at all, in what its catalogue calls typical."""
_SPAN = 0.25
"""One sigma of another parameter of a cause around its typical value, of the width of its bounds."""


def problem_of(name: str, rig: Rig, cases: Sequence[Case]) -> Problem:
    """Return the problem of a rig with one more cause, or none."""
    nominal = unknowns_of(rig, cases)
    stated = frozenset(e.name for e in rig.effects)
    if name == NOTHING:
        return Problem(tuple(cases), rig, nominal, MEASURED, stated=stated)
    effect = effect_named(name)
    with_it = rig.with_effects(*rig.effects, EffectSetting(name, effect.complete(effect.null)))
    free = unknowns_of_effect(effect, effect.typical, rig.known | idle(effect, rig))
    parameters = {f"{name}.{p.name}": p for p in effect.parameters}
    doubted = tuple(_with_prior(u, parameters[u.name], u.name == f"{name}.{effect.main.name}") for u in free)
    return Problem(tuple(cases), with_it, (*nominal, *doubted), MEASURED, stated=stated)


def _with_prior(unknown: Unknown, parameter: Parameter, is_size: bool) -> Unknown:
    """Return an unknown of a cause with a prior: its size around null, the rest around typical values."""
    typical, null = unknown.inner(parameter.typical), unknown.start
    if is_size and (parameter.null > 0.0 or not parameter.logarithmic) and math.isfinite(parameter.null):
        null = unknown.inner(parameter.null)
        return replace(unknown, start=parameter.null, doubt=_SIZES * abs(typical - null) or unknown.reach)
    if math.isfinite(parameter.spread):
        return unknown
    return replace(unknown, doubt=_SPAN * _width(unknown, parameter))


def _width(unknown: Unknown, parameter: Parameter) -> float:
    """Return how far the parameter can reach in the fit's coordinate; 16 times where it has no bound."""
    ends = (parameter.low, parameter.high)
    if (unknown.logarithmic and parameter.low <= 0.0) or not all(map(math.isfinite, ends)):
        return math.log(16.0) if unknown.logarithmic else 16.0 * abs(parameter.typical or 1.0)
    width = unknown.inner(parameter.high) - unknown.inner(parameter.low)
    return min(width, 16.0 * unknown.scale)


def vector_at(problem: Problem, near: Mapping[str, float], start: Mapping[str, float]) -> FloatArray:
    """Return coordinates of a problem: `start` where it says, else `near` (coordinates), else its prior."""
    return np.array(
        [
            u.inner(min(max(start[u.name], u.low), u.high))
            if u.name in start
            else near.get(u.name, u.inner(u.start))
            for u in problem.unknowns
        ]
    )


def weights_of(problem: Problem) -> FloatArray:
    """Return the information of the prior, shape (n,)."""
    return np.array([1.0 / u.reach**2 for u in problem.unknowns])
