"""Where the desired torque will be when a command acts: a parabola through it, with fading memory.

    r'[k|k-1] = A r[k-1],   r[k] = r'[k|k-1] + g (desired[k] - r'[k|k-1])

r is (torque, T rate, T^2 second rate). With memory m the error one sample ahead is ((1 - 1/z) / (1 -
m/z))^3: none for a torque that moves along a parabola. Morrison, Introduction to Sequential Smoothing and
Prediction, 1969, ch. 13.
"""

from __future__ import annotations

import math

import numpy as np

from rsea_ros.control.sampled import z_of
from rsea_ros.signals import ComplexArray, FloatArray

ALONG: FloatArray = np.array([[1.0, 1.0, 0.5], [0.0, 1.0, 1.0], [0.0, 0.0, 1.0]])
AHEAD = 2
"""Samples from a measurement to the end of the hold of the command that it leads to."""


class Prediction:
    """Follow a desired torque sample by sample. corner: Hz, above which it is taken for noise."""

    def __init__(self, corner: float, period: float) -> None:
        memory = math.exp(-2.0 * math.pi * corner * period)
        self._gains = gains_of(memory)
        self.start(0.0)

    def start(self, torque: float) -> None:
        """Begin at rest at a torque, N m."""
        self._state: FloatArray = np.array([torque, 0.0, 0.0])

    def ahead(self, desired: float, samples: int) -> FloatArray:
        """Take the desired torque of this sample; return it from AHEAD samples on: shape (samples,)."""
        expected = ALONG @ self._state
        self._state = expected + self._gains * (desired - expected[0])
        r, rate, second = self._state
        j = AHEAD + np.arange(samples)
        along: FloatArray = r + j * rate + 0.5 * j * j * second
        return along


def gains_of(memory: float) -> FloatArray:
    """Return g for a memory from 0 (the last three samples) to below 1."""
    fresh = 1.0 - memory
    return np.array([1.0 - memory**3, 1.5 * fresh**2 * (1.0 + memory), fresh**3])


def prediction_response(corner: float, period: float, hz: FloatArray) -> ComplexArray:
    """Return predicted over true torque at the end of the hold, at frequencies, Hz: 1 is no error."""
    g = gains_of(math.exp(-2.0 * math.pi * corner * period))
    z = z_of(period, hz)
    first = np.array([1.0, 0.0, 0.0])
    to_state = np.eye(3) - (np.eye(3) - np.outer(g, first)) @ ALONG / z[:, None, None]
    states = np.linalg.solve(to_state, np.broadcast_to(g.astype(complex)[:, None], (len(z), 3, 1)))[..., 0]
    response: ComplexArray = states @ np.linalg.matrix_power(ALONG, AHEAD)[0] / z**AHEAD
    return response
