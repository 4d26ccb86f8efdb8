"""Starts of an effect's fit at the values that the rig states.

A fit without the missing effect may carry a value far from the rig's, to imitate it: a lag of the motor's
current becomes sixteen times the rotor's damping. A fit of the right effect that begins there can end in a
poor minimum, where one that begins at the stated values does not.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from rsea_ros.effects.effect import Effect
from rsea_ros.identification.off_rig import FAR
from rsea_ros.identification.problem import Problem
from rsea_ros.identification.solver import Solution
from rsea_ros.signals import FloatArray


def is_off_rig(solution: Solution) -> bool:
    """Return whether a value of the rig is fitted farther from the stated one than its doubt allows."""
    stated = solution.problem.rig.free()
    unknowns = zip(solution.problem.unknowns, solution.theta, strict=True)
    return any(u.name in stated and u.sigmas(float(t)) > FAR for u, t in unknowns)


def stated_starts(problem: Problem, theta: FloatArray, effect: Effect) -> list[FloatArray]:
    """Return theta with the values that the rig states, once for each default guess of an effect in it."""
    stated = {u.name: u.start for u in problem.unknowns if u.name in problem.rig.free()}
    guesses = [{f"{effect.name}.{name}": v for name, v in g.items()} for g in effect.default_guesses]
    return [_with_values(problem, theta, {**stated, **guess}) for guess in guesses]


def _with_values(problem: Problem, theta: FloatArray, values: Mapping[str, float]) -> FloatArray:
    unknowns = zip(problem.unknowns, theta, strict=True)
    return np.array([u.inner(values[u.name]) if u.name in values else float(t) for u, t in unknowns])
