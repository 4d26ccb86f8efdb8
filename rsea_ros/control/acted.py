"""Which torque a measured one is: the command that is ending at its sample, or the one that begins there.

A bench that reads before it writes measures the command of the sample before. A driver that writes first, so
that a command acts near its instant, reads a current that is the new command's already; a current loop that
lags, or a motor that looks at its goal now and then, is somewhere between. The part a of the new command is
learned by least squares with forgetting, from what the controller has sent:

    m[k] = (1 - a) u[k-1] + a u[k],     acted over the sample before = (1 - a) m[k] + a m[k-1]
"""

from __future__ import annotations

import math

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
