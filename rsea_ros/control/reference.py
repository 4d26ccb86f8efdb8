"""The model of the bench that runs one hold ahead of it: what the torque should be, and the command for that.

At sample k the model is where the bench will be at k+1, when the command of this sample begins to act. What
limits take away from a command is taken from the model too.
"""

from __future__ import annotations

import numpy as np

from rsea_ros.control.feedforward import inverse
from rsea_ros.control.sampled import FT, VELOCITY, Sampled
from rsea_ros.signals import FloatArray


class Reference:
    """now, next: ft, velocity, position of the model at this sample and at the next one, shape (3,).

    promised: the desired torques (N m) that the model was steered to at these two.
    """

    def __init__(self, plant: Sampled) -> None:
        self._plant, self._inverse = plant, inverse(plant)
        self.samples = max(self._inverse.moves, 2)
        self.start(0.0, 0.0, 0.0)

    def start(self, ft: float, velocity: float, desired: float) -> None:
        """Begin where the bench is, N m and rad/s, on the way to a desired torque, N m."""
        seen = self._plant.c[[FT, VELOCITY]]
        self._x: FloatArray = np.linalg.lstsq(seen, np.array([ft, velocity]), rcond=None)[0]
        self.now = self.next = self._plant.c @ self._x
        self.promised = (desired, desired)

    def torque(self, desired: FloatArray) -> float:
        """Return the command, N m, that leads to the desired torques from k+2 on, shape (samples,)."""
        off = float(self.next[FT]) - self.promised[1]
        return self._inverse.torque(self._x, desired[: self._inverse.moves], off)

    def after(self, torque: float) -> FloatArray:
        """Return ft, velocity and position at the end of the hold of a torque (N m)."""
        end: FloatArray = self._plant.c @ (self._plant.a @ self._x + self._plant.b * torque)
        return end

    def advance(self, torque: float, promised: float) -> None:
        """Go on by a sample with a torque (N m) that was to lead to the promised one."""
        self._x = self._plant.a @ self._x + self._plant.b * torque
        self.now, self.next = self.next, self._plant.c @ self._x
        self.promised = (self.promised[1], promised)
