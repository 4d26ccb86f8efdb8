"""Feed-forward: the inverse of the sampled bench, computed from a model that runs one hold ahead of it.

The model's torque j samples after the start of a hold is c A^j x + g_j u, with g_j = c (A^(j-1) + … + 1) B.
The command makes it the desired one in the sense of least squares over the first `moves` samples, u held
over them:

    u = sum g_j (r_j + e fade^j - c A^j x) / sum g_j^2

e is what the model's torque differs from the desired one at the start: after a limit it comes back within a
few `fade`, not at once, which would reach the limit again and again. One sample is the exact inverse, which
needs the bench's sampled zeros inside the unit circle and away from -1, where u would jump up and down.
`moves` is the least number for which the inverse does not, or at least is stable, and no less than HORIZON
has: over one sample of 1 kHz an error of 0.1 N m in the desired torque would take 62 N m of the motor, over
three 7. Since u follows from the state of the model, the model may receive another torque than u (a limit),
and nothing winds up.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rsea_ros.control.sampled import FT, Sampled
from rsea_ros.errors import ParameterError
from rsea_ros.records.record import FloatArray

MOST_MOVES = 8
JUMPY = -0.5
"""A pole of the inverse further left than this makes it jump from sample to sample."""

RECOVERY = 20.0
"""Hz: how fast the model comes back to the desired torque after a limit."""

HORIZON = 3e-3
"""s over which the model is brought to the desired torque."""

FREE = 1e-6
"""An end that turns freely has a pole at 1, which the torque does not show."""


@dataclass(frozen=True)
class Inverse:
    """u = weights · (r + e fading - free x). weights, fading: shape (moves,). free: shape (moves, n)."""

    plant: Sampled
    weights: FloatArray
    free: FloatArray
    fading: FloatArray

    @property
    def moves(self) -> int:
        """How many samples of the desired torque a command looks at."""
        return len(self.weights)

    def torque(self, x: FloatArray, desired: FloatArray, off: float = 0.0) -> float:
        """Return the command, N m. x: the model at the start of the hold. desired: shape (moves,), after it.

        off: N m, torque of the model less the desired one at the start.
        """
        return float(self.weights @ (desired + off * self.fading - self.free @ x))


def inverse(plant: Sampled) -> Inverse:
    """Return the inverse of a bench. Raises ParameterError where none of them is stable."""
    least = min(MOST_MOVES, max(1, round(HORIZON / plant.period)))
    candidates = [_inverse(plant, moves) for moves in range(least, MOST_MOVES + 1)]
    stable = [c for c in candidates if np.abs(inverse_poles(c)).max() < 1.0 + FREE]
    smooth = [c for c in stable if inverse_poles(c).real.min() > JUMPY]
    if stable:
        return (smooth or stable)[0]
    raise ParameterError(
        f"feed-forward: no inverse over {least} to {MOST_MOVES} samples of {1e3 * plant.period:g} ms is "
        "stable, expected a bench whose torque follows the motor"
    )


def inverse_poles(inverse: Inverse) -> FloatArray:
    """Return the poles of the model under its inverse."""
    plant = inverse.plant
    closed = plant.a - np.outer(plant.b, inverse.weights @ inverse.free)
    return np.asarray(np.linalg.eigvals(closed))


def _inverse(plant: Sampled, moves: int) -> Inverse:
    free, forced, x = [], [], np.zeros_like(plant.b)
    power = np.eye(len(plant.a))
    for _ in range(moves):
        x = plant.a @ x + plant.b
        power = plant.a @ power
        free.append(plant.c[FT] @ power)
        forced.append(float(plant.c[FT] @ x))
    g = np.array(forced)
    fade = np.exp(-2.0 * np.pi * RECOVERY * plant.period)
    return Inverse(plant, g / (g @ g), np.array(free), fade ** np.arange(1, moves + 1))
