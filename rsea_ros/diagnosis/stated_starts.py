"""Starts of an effect's fit at the values that the rig states.

A fit without the missing effect may carry a value far from the rig's, to imitate it: a lag of the motor's
current becomes sixteen times the rotor's damping. A fit of the right effect that begins there can end in a
poor minimum, where one that begins at the stated values does not.
"""

from __future__ import annotations

from rsea_ros.effects.effect import Effect
from rsea_ros.identification.problem import Problem
from rsea_ros.identification.unknowns import theta_with
from rsea_ros.records.record import FloatArray


def stated_starts(problem: Problem, theta: FloatArray, effect: Effect) -> list[FloatArray]:
    """Return theta with the values that the rig states, once for each default guess of an effect in it."""
    stated = problem.rig.free()
    rig = {u.name: u.start for u in problem.unknowns if u.name in stated}
    guesses = [{f"{effect.name}.{name}": v for name, v in g.items()} for g in effect.default_guesses]
    return [theta_with(problem.unknowns, theta, {**rig, **guess}) for guess in guesses]
