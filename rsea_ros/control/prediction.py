"""Prediction over the delay from the commands that have acted.

r'[k|k-1] = A r[k-1],   r[k] = r'[k|k-1] + g (desired[k] - r'[k|k-1])
    ahead = trust (desired + rate j + second j^2 / 2) + (1 - trust) smooth
    trust = 1 / (1 + (surprise / (0.3 change))^4)

r is (torque, T rate, T^2 second rate). A desired torque that comes a part of a sample early or late, or
after several, is taken for its own instant: A and g are those of the interval; a jitter of 0.1 samples made
65 N m at the motor of 10 N m at 5 Hz. With memory m the error one sample ahead is ((1 - 1/z) / (1 -
m/z))^3: none for a torque that moves along a parabola (Morrison, Introduction to Sequential Smoothing and
Prediction, 1969, ch. 13). Where the torque surprises the parabola by much of what it changes by in a sample
(RMS of the last few: a step, noise, a sine faster than a fifteenth of the rate) it is taken through a low
pass, two samples late: prediction amplifies fast changes, and then would only amplify;
a jump passed unfiltered would need 50 N m of the motor per N m at 280 Hz.

A bench that reads before it writes measures the command of the sample before. A driver that writes first, so
that a command acts near its instant, reads a current that is the new command's already; a current loop that
lags, or a motor that looks at its goal now and then, is somewhere between. The part a of the new command is
learned by least squares with forgetting, from what the controller has sent:

    m[k] = (1 - a) u[k-1] + a u[k],     acted over the sample before = (1 - a) m[k] + a m[k-1]
"""

import math
from functools import lru_cache

import numpy as np

from rsea_ros.records.record import FloatArray

AHEAD = 2
"""Samples from a measurement to the end of the hold of the command that it leads to."""
SURPRISING = 0.3
"""Part of the change in a sample that a surprise must be small against: a sine at 1/15 of the rate has it."""
SMOOTH = 40.0
"""Hz, of the low pass, twice: -3 dB at 26 Hz, and no overshoot."""
SAME = 1e-3
"""Samples: desired torques nearer than this are one."""
COASTED = 3.0
"""Samples in which the course of a desired torque that is not renewed comes to rest."""
FADE = 0.2
"""Part by which a sample replaces the mean square of those before, and a sender's pace comes back to one."""
SENDER = 0.4
"""Of the rate of a sender that pauses: the low pass is no faster (decision 392)."""


class Prediction:
    """Follow a desired torque sample by sample. corner: Hz, above which it is taken for noise."""

    def __init__(self, corner: float, period: float) -> None:
        self._memory = math.exp(-2.0 * math.pi * corner * period)
        self._period = period
        self.start(0.0)

    def start(self, torque: float) -> None:
        """Begin at rest at a torque, N m."""
        self._state: FloatArray = np.array([torque, 0.0, 0.0])
        self._smooth, self._off = (torque, torque), 0.0
        self._last, self._surprise, self._change, self.trust = torque, 0.0, 0.0, 1.0
        self._promised, self._rest, self._pace = torque, (0.0, 0.0), 1.0

    def expected(self, samples: int) -> float:
        """Return the torque, N m, that is expected a number of samples after the last one."""
        along = self._state[1] * samples + 0.5 * self._state[2] * samples * samples
        return float(self._state[0] + self.trust * along)

    def between(self, desired: float, missed: int) -> FloatArray:
        """Return the torques (N m) of samples that were missed before one of `desired`: shape (missed,).

        The predictions, plus the error of the last one as a cubic in time, without a kink.
        """
        i = np.arange(1.0, missed + 2.0)
        expected = self._state[0] + self.trust * (self._state[1] * i + 0.5 * self._state[2] * i * i)
        path: FloatArray = expected + (desired - expected[-1]) * (i / (missed + 1.0)) ** 3
        return path[:-1]

    def ahead(self, desired: float, samples: int, off: float = 0.0) -> FloatArray:
        """Take the desired torque of this sample; return it from AHEAD samples on: shape (samples,).

        off: samples by which the desired torque is for later than this sample; one less than at the sample
        before says that it is the same one, and its course goes on.
        """
        interval, self._off = 1.0 + off - self._off, off
        if interval > SAME:
            expected = course(interval) @ self._state
            surprise = desired - expected[0]
            self._state = expected + gains_of(self._memory**interval, interval) * surprise
            self._trust(surprise, desired)
            self._pace = max(interval, self._pace + FADE * (1.0 - self._pace))
        (rate, second), (j, half_square) = self._state[1:], instants(off, samples)
        passed = self._passed(*self._smooth, desired, samples + 1)
        self._smooth, along = passed[0], np.array([second for _, second in passed])
        along += self.trust * (desired + j * rate + half_square * second - along)
        return self._eased(along, 1.0 - 1.0 / max(interval, 1.0))[:samples]

    def _eased(self, along: FloatArray, part: float) -> FloatArray:
        """Return a course that comes from the one before, a part of the difference through the low pass."""
        first, second = self._rest
        off = part * (self._promised - float(along[0]) - second)
        passed = self._passed(first + off, second + off, 0.0, len(along))
        self._rest = passed[0]
        along += [second + off, *(after for _, after in passed[:-1])]
        self._promised = float(along[1])
        return along

    def _passed(self, first: float, second: float, towards: float, samples: int) -> list[tuple[float, float]]:
        """Return both stages of the low pass in the samples to come of a constant input."""
        corner = min(SMOOTH * self._period, max(SMOOTH * self._period, SENDER) / self._pace)
        path, soft = [], -math.expm1(-2.0 * math.pi * corner)
        for _ in range(samples):
            first += soft * (towards - first)
            second += soft * (first - second)
            path.append((first, second))
        return path

    def _trust(self, surprise: float, desired: float) -> None:
        self._surprise += FADE * (surprise**2 - self._surprise)
        self._change += FADE * ((desired - self._last) ** 2 - self._change)
        self._last = desired
        share = self._surprise / max(SURPRISING**2 * self._change, 1e-300)
        self.trust = 1.0 / (1.0 + min(share, 1e6) ** 2) if self._change > 0.0 else 1.0


@lru_cache(maxsize=64)
def instants(off: float, samples: int) -> tuple[FloatArray, FloatArray]:
    """Return the samples j over which a course goes on, as it comes to rest, and j^2 / 2."""
    j, needed = AHEAD - off + np.arange(samples + 1), AHEAD + samples - 1
    j = np.minimum(j, needed) - COASTED * np.expm1(-np.maximum(j - needed, 0.0) / COASTED)
    return j, 0.5 * j * j


@lru_cache(maxsize=64)
def course(interval: float) -> FloatArray:
    """Return A over an interval, samples."""
    return np.array([[1.0, interval, 0.5 * interval**2], [0.0, 1.0, interval], [0.0, 0.0, 1.0]])


@lru_cache(maxsize=64)
def gains_of(memory: float, interval: float = 1.0) -> FloatArray:
    """Return g for a memory over an interval (samples), from 0 (the last three values) to below 1."""
    fresh = 1.0 - memory
    rate, second = 1.5 * fresh**2 * (1.0 + memory) / interval, fresh**3 / interval**2
    return np.array([1.0 - memory**3, rate, second])


MEMORY = 0.5
"""s of changes, as of the controller's learning (learning.py)."""
CHANGES = 0.3
"""N m: a command that changes by less teaches nothing beside the quantum of a current (0.11 N m); and so much
speaks for the command of the sample before, at first."""


class Acted:
    """Follow measured torques sample by sample. part: a, from 0 to 1."""

    def __init__(self, period: float) -> None:
        """period: s."""
        self._fresh = 1.0 - math.exp(-period / MEMORY)
        self._together, self._square, self.part = 0.0, CHANGES**2, 0.0
        self.start(0.0)

    def start(self, measured: float) -> None:
        """Begin at a measured torque, N m, and keep what was learned."""
        self._last = measured

    def over_sample(self, measured: float, before: float, newest: float, *, sure: bool = True) -> float:
        """Return the torque (N m) that acted over the sample that has just ended.

        measured: N m, of this sample. before, newest: N m, commands over the sample before and from this
        one on. sure: whether they acted in time and no sample was lost; else nothing is learned.
        Without a measured torque it is nan.
        """
        if math.isnan(measured):
            return measured
        change = newest - before
        if sure and abs(change) > CHANGES:
            self._together += self._fresh * ((measured - before) * change - self._together)
            self._square += self._fresh * (change * change - self._square)
            self.part = min(max(self._together / self._square, 0.0), 1.0)
        acted = measured + self.part * (self._last - measured)
        self._last = measured
        return acted
