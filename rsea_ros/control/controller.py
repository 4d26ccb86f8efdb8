"""The torque controller: prediction, feed-forward, feedback, compensation and limits, one sample at a time.

    r      = where the desired torque will be when the command acts        prediction.py
    u_ff   = inverse of the model, which runs one hold ahead               feedforward.py
    u_fb   = PD on (torque of the model - ft), disturbance observer        law.py
    u_c    = friction, ripple, backlash, from the model's own motion       compensation.py
    u      = u_ff + u_fb + u_c within the limits

What the limits take away is taken from the model too. So the torque that feedback asks for is always one
that the motor can make, nothing winds up, and the bench comes back to the desired torque as fast as the
limits let it.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from rsea_ros.control.compensation import COMPENSATED, Compensation, compensation
from rsea_ros.control.feedforward import Inverse, inverse
from rsea_ros.control.law import Gains, Law, State, feedback, hold, law_of
from rsea_ros.control.prediction import Prediction
from rsea_ros.control.sampled import FT, POSITION, VELOCITY, Sampled, sampled
from rsea_ros.model.rig import Rig
from rsea_ros.signals import FloatArray

CORNER = 50.0
"""Hz: what a desired torque does faster is not predicted. At 280 Hz 5 Hz are predicted within 1.4 %."""


@dataclass(frozen=True)
class Limits:
    """torque: N m. slew: N m/s. ramp: s in which the limit grows from zero after the start."""

    torque: float = 68.0
    slew: float = 40_000.0
    ramp: float = 0.25


@dataclass(frozen=True)
class Reading:
    """One sample of the bench: N m, rad/s, rad."""

    ft: float
    velocity: float
    position: float


@dataclass(frozen=True)
class Share:
    """What a command is made of, N m; reference: the torque that the model has at this sample."""

    reference: float = 0.0
    feedforward: float = 0.0
    feedback: float = 0.0
    compensation: float = 0.0
    command: float = 0.0
    limited: bool = False


class TorqueController:
    """Makes commands out of readings and desired torques. A command acts one sample after its reading."""

    def __init__(self, rig: Rig, rate: float, gains: Gains, *, limits: Limits | None = None,
                 compensate: Iterable[str] = COMPENSATED, preview: bool = False) -> None:  # fmt: skip
        """rate: Hz. preview: desired torques are those of two samples later, known ahead: no prediction."""
        self._law: Law = law_of(rig, rate, gains)
        self._model: Sampled = sampled(rig, rate)
        self._inverse: Inverse = inverse(self._model)
        self._compensation: Compensation = compensation(rig, compensate)
        self._prediction = Prediction(CORNER, 1.0 / rate)
        self._preview, self._limits = preview, limits or Limits()
        self.start(Reading(0.0, 0.0, 0.0))

    def start(self, reading: Reading) -> None:
        """Begin anew, from zero torque, with the bench as it is: nothing jumps."""
        wanted = np.array([reading.ft, reading.velocity])
        self._x: FloatArray = np.linalg.lstsq(self._model.c[[FT, VELOCITY]], wanted, rcond=None)[0]
        self._now = self._next = self._model.c @ self._x
        self._state = State(ft=reading.ft, velocity=reading.velocity)
        self._prediction.start(reading.ft)
        self._told = np.full(2, reading.ft)
        self._age = 0
        self.share = Share()

    def step(self, reading: Reading, desired: float, missed: int = 0) -> float:
        """Return the torque (N m) that acts from the next sample on.

        desired: N m, at this sample, or two samples later with preview. missed: samples lost since the last
        one.
        """
        for _ in range(missed):
            self._coast(desired)
        state = _between(self._state, reading, missed)
        ahead = self._ahead(desired)
        forward = self._inverse.torque(
            self._x, ahead[: self._inverse.moves], float(self._next[FT] - self._told[1])
        )
        back, state = feedback(
            self._law, state, float(self._now[FT]) - reading.ft, reading.ft, reading.velocity
        )
        known, crossing = self._compensated(reading, forward), self._crossing(ahead)
        asked = forward + back + known + crossing
        torque = self._within(asked)
        self._state = hold(state, torque - known)
        reference = float(self._now[FT])
        self._told = np.array([self._told[1], ahead[0]])
        self._advance(forward + torque - asked)
        self.share = Share(reference, forward, back, known + crossing, torque, torque != asked)
        return torque

    def _ahead(self, desired: float) -> FloatArray:
        samples = max(self._inverse.moves, 2)
        return np.full(samples, desired) if self._preview else self._prediction.ahead(desired, samples)

    def _coast(self, desired: float) -> None:
        """Pass over a sample that did not come: the last torque goes on acting, the model stays."""
        self._ahead(desired)
        self._state = hold(self._state, self._state.newest)
        self._now = self._next

    def _advance(self, torque: float) -> None:
        self._x = self._model.a @ self._x + self._model.b * torque
        self._now, self._next = self._next, self._model.c @ self._x
        self._age += 1

    def _compensated(self, reading: Reading, forward: float) -> float:
        """Return the torque against friction and ripple, N m, of the motion that the model will make."""
        c, model = self._compensation, self._model
        if not (c.frictions or c.ripples):
            return 0.0
        end = model.c @ (model.a @ self._x + model.b * forward)
        off = reading.position - float(self._now[POSITION])
        friction = c.friction(float(self._next[VELOCITY]), float(end[VELOCITY]))
        return friction + c.ripple(off + float(self._next[POSITION]), off + float(end[POSITION]))

    def _crossing(self, ahead: FloatArray) -> float:
        """Return J w' + b w of the way across the gap, N m, mean over the hold, by central differences."""
        c, h = self._compensation, self._law.period
        if not c.gap:
            return 0.0
        way = [c.way(float(torque)) for torque in (*self._told, ahead[0], ahead[1])]
        start, stop = 0.5 * (way[2] - way[0]) / h, 0.5 * (way[3] - way[1]) / h
        return self._law.inertia * (stop - start) / h + 0.5 * self._law.damping * (start + stop)

    def _within(self, torque: float) -> float:
        limits, before = self._limits, self.share.command
        step = limits.slew * self._law.period
        grown = min(1.0, (self._age + 1) * self._law.period / limits.ramp) if limits.ramp > 0.0 else 1.0
        torque = min(max(torque, before - step), before + step)
        return min(max(torque, -limits.torque * grown), limits.torque * grown)


def _between(s: State, reading: Reading, missed: int) -> State:
    """Return the state as if the sample before had been read on a straight line."""
    share = missed / (missed + 1)
    return s._replace(
        ft=s.ft + share * (reading.ft - s.ft), velocity=s.velocity + share * (reading.velocity - s.velocity)
    )
