"""Play between gear output and chassis, housing free: linear pieces solved exactly, events by their roots.

Nothing of `rsea_ros.model` or of the effect is used. Coordinates (h, g, c): housing with its pendulum, gear
output, spring chassis, absolute, rad; the rotor is an inerter between h and g; the spring holds c to ground.

    apart      |g - c| < gap / 2, until they meet: inelastic impact, momentum of all three bodies kept
    touching   g - c = ± gap / 2, as long as the flank pushes
"""

from __future__ import annotations

import math

import numpy as np
from scipy.linalg import expm
from scipy.optimize import brentq

J_M, J_SC, B_M, K_S, B_S, RATIO = 0.953, 0.0040, 23.088, 1530.456, 3.0, 502.0
J_H, B_H, K_H = 0.101, 0.02, 7.0
_TURNS = np.array([1.0 - RATIO, RATIO, 0.0])  # of the rotor, for one of each body
MASS = J_M / RATIO**2 * np.outer(_TURNS, _TURNS) + np.diag([J_H, 0.0, J_SC])
DAMPING = B_M * np.outer([1.0, -1.0, 0.0], [1.0, -1.0, 0.0]) + np.diag([B_H, 0.0, B_S])
STIFFNESS = np.diag([K_H, 0.0, K_S])
MOTOR, APART = np.array([-1.0, 1.0, 0.0]), np.array([0.0, 1.0, -1.0])
YIELDING = np.linalg.solve(MASS, APART) / (APART @ np.linalg.solve(MASS, APART))
"""What an impulse between the flanks does to the three speeds, for each rad/s between them."""


def generator(touching: bool) -> np.ndarray:
    """Return A of x' = A x, x = (angles, speeds, motor torque)."""
    inverse = np.linalg.inv(MASS)
    if touching:
        inverse = inverse - np.outer(YIELDING, APART @ inverse)
    rows = inverse @ np.column_stack([-STIFFNESS, -DAMPING, MOTOR])
    return np.vstack([np.column_stack([np.zeros((3, 3)), np.eye(3), np.zeros(3)]), rows, np.zeros(7)])


FREE, TOUCHING = generator(False), generator(True)
PUSH = J_SC * TOUCHING[5] + K_S * np.eye(7)[2] + B_S * np.eye(7)[5]
"""What the flank pushes the chassis with, N m, from x."""


class Bench:
    """One run. side: of the flank that touches, 0: none. impacts: when they were, s."""

    def __init__(self, gap: float, step: float) -> None:
        """gap: rad. step: s, between looks for an event."""
        self._half, self._step, self.side = 0.5 * gap, step, 0
        self._time, self.impacts = 0.0, list[float]()
        self._held = {matrix[3:6].tobytes(): expm(matrix * step) for matrix in (FREE, TOUCHING)}
        self.x = np.zeros(7)

    def hold(self, torque: float, period: float) -> tuple[float, float]:
        """Hold a motor torque (N m); return position (rad) and torque at the F/T sensor (N m) after it."""
        self.x[6], left = torque, period
        while left > 1e-12:
            passed = self._advance(min(self._step, left))
            left -= passed
            self._time += passed
        return self.x[1] - self.x[0], K_S * self.x[2] + B_S * self.x[5]

    def _advance(self, time: float) -> float:
        """Go on by a time or to the next event in it, s; return which."""
        matrix = TOUCHING if self.side else FREE
        after = self._after(matrix, time)
        if self._beyond(self.x) > 0.0 or self._beyond(after) <= 0.0:
            past = self._beyond(self.x) > 0.0  # has just changed sides: an event lies behind it
            self.x = after
            if not past or self._beyond(after) <= 0.0:
                return time
        else:
            time = brentq(lambda t: self._beyond(self._after(matrix, t)), 0.0, time, xtol=1e-15)
            self.x = self._after(matrix, time)
        self._change(self._time + time)
        return time

    def _after(self, matrix: np.ndarray, time: float) -> np.ndarray:
        held = self._held[matrix[3:6].tobytes()] if time == self._step else expm(matrix * time)
        return held @ self.x

    def _beyond(self, x: np.ndarray) -> float:
        """Return how far the state is beyond its phase: positive from the event on."""
        return -self.side * float(PUSH @ x) if self.side else abs(x[1] - x[2]) - self._half

    def _change(self, now: float) -> None:
        """Leave the flank, or meet one."""
        if self.side:
            self.side = 0
            return
        self.side = int(math.copysign(1, self.x[1] - self.x[2]))
        self.impacts.append(now)
        self.x[3:6] -= YIELDING * (APART @ self.x[3:6])
        self.x[1] = self.x[2] + self.side * self._half


def response(command: np.ndarray, period: float, gap: float) -> tuple[np.ndarray, np.ndarray]:
    """Return position and F/T torque after each hold, shape (n, 2), and when the flanks met, s."""
    bench = Bench(gap, period / 40.0)
    return np.array([bench.hold(float(torque), period) for torque in command]), np.array(bench.impacts)
