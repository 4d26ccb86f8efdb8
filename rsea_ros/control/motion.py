"""The motion for a torque with an unknown load, in linear parameters.

    w = theta_0 s T / (K_s + b_s s) + theta_1 s T / (s + w_1)^2 + theta_2 w_1 s T / (s + w_1)^3

w is the speed of the gear against the housing. The first part stretches the spring (theta_0 = 1 if K_s is
right), the others follow the load: an inertia J_l gives way by T / (J_l s), so that theta_1 is 1 / J_l, 0 for
a load that stands still; damping and gravity come with theta_2. All three have stable poles whatever theta
is, and none of them answers to a torque that stands: a motor that waits at a torque is not sent away.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.linalg import expm

from rsea_ros.records.record import FloatArray

SLOW = 2.0 * math.pi * 1.5
"""w_1, rad/s: below 1.5 Hz the motion of the load is left to feedback."""

LOCKED: FloatArray = np.array([1.0, 0.0, 0.0])


class Stretch:
    """phi of a spring, rad, and its mean rate over a sample, for a torque that goes straight in it."""

    def __init__(self, stiffness: float, damping: float, period: float) -> None:
        """SI."""
        a = stiffness / damping if damping > 0.0 else math.inf
        self._pole = math.exp(-a * period)
        after = (1.0 - self._pole) / (a * period) if math.isfinite(a) else 0.0
        self._on = ((after - self._pole) / stiffness, (1.0 - after) / stiffness)
        self._compliance, self._period = 1.0 / stiffness, period
        self.start(0.0)

    def start(self, torque: float) -> None:
        """Begin at rest at a torque, N m."""
        self._phi, self._torque = torque * self._compliance, torque

    def rate(self, torque: float) -> float:
        """Take the torque (N m) at the end of a sample; return the mean rate over it, rad/s."""
        phi = self._pole * self._phi + self._on[0] * self._torque + self._on[1] * torque
        rate = (phi - self._phi) / self._period
        self._phi, self._torque = phi, torque
        return rate


class Yielding:
    """The motion with the load: the parts of theta_1 and theta_2, at the samples."""

    def __init__(self, period: float) -> None:
        n = 3
        generator = np.zeros((n + 1, n + 1))
        generator[:n, :n] = -SLOW * np.eye(n) + np.diag(np.ones(n - 1), -1)
        generator[0, n] = 1.0
        held = expm(generator * period)
        self._a, self._b = held[:n, :n], held[:n, n]
        self._c: FloatArray = np.array([[1.0, -SLOW, 0.0], [0.0, SLOW, -(SLOW**2)]])
        self.start(0.0)

    def start(self, torque: float) -> None:
        """Begin at rest at a torque, N m."""
        self._z: FloatArray = torque / SLOW ** np.arange(1.0, 4.0)

    def after(self, torque: float) -> FloatArray:
        """Return both parts at the end of a sample with a mean torque, N m: rad/s for theta = 1."""
        parts: FloatArray = self._c @ (self._a @ self._z + self._b * torque)
        return parts

    def advance(self, torque: float) -> FloatArray:
        """Go on by a sample with a mean torque, N m; return the parts at its end."""
        self._z = self._a @ self._z + self._b * torque
        parts: FloatArray = self._c @ self._z
        return parts
