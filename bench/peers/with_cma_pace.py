"""CMA-ES on the five values that PACE fits for a joint: armature, viscous and dry friction, delay, bias.

Source: PACE (leggedrobotics/pace-sim2real): inertia, damping, friction and bias of each joint, one delay. All
else, such as the stiffness of a spring, stays as stated.
"""

from __future__ import annotations

from common import PeerCase, PeerResult
from evolution import evolve, predict


def fit(case: PeerCase) -> PeerResult:
    """Fit the five values."""
    size = case.meta["torque"]
    free = {"inertia": (1.0, True), "damping": (1.0, True), "friction": (0.1 * size, False)}
    free |= {"delay": (5e-3, False), "bias": (case.meta["bias"], False)}
    values, _ = evolve(case, free, case.split, 0.9 * case.seconds_left)
    shown = {n: values[n] for n in ("inertia", "damping", "friction", "delay")}
    return PeerResult(predict(case, values), shown)
