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

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from rsea_ros.control.compensation import COMPENSATED, Compensation, compensation
from rsea_ros.control.law import Gains, Law, State, feedback, hold, law_of
from rsea_ros.control.prediction import Prediction
from rsea_ros.control.reference import Reference
from rsea_ros.control.sampled import FT, POSITION, VELOCITY, sampled
from rsea_ros.model.rig import Rig
from rsea_ros.signals import FloatArray

CORNER = 80.0
"""Hz: what a desired torque does faster is not predicted. At 280 Hz 5 Hz are predicted within 0.9 %."""


@dataclass(frozen=True)
class Limits:
    """torque: N m. slew: N m/s. ramp: s in which the limit grows after the start."""

    torque: float = 68.0
    slew: float = 40_000.0
    ramp: float = 0.25


@dataclass(frozen=True)
class Reading:
    """One sample of the bench: N m, rad/s, rad; motor_torque: N m over the sample before, nan if unknown.

    The measured torque tells of a command that came late or was cut down by the driver.
    """

    ft: float
    velocity: float
    position: float
    motor_torque: float = math.nan


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
                 compensate: Iterable[str] = COMPENSATED, preview: bool = False,
                 corner: float = CORNER) -> None:  # fmt: skip
        """rate: Hz. preview: desired torques are those of two samples later, known ahead: no prediction.

        corner: of the prediction, Hz.
        """
        self._law: Law = law_of(rig, rate, gains)
        self._reference = Reference(sampled(rig, rate))
        self._compensation: Compensation = compensation(rig, compensate)
        self._prediction = Prediction(corner, 1.0 / rate)
        self._preview, self._limits = preview, limits or Limits()
        self.start(Reading(0.0, 0.0, 0.0))

    def start(self, reading: Reading, desired: float = 0.0) -> None:
        """Begin anew with the bench as it is, from the torque that the motor makes now: nothing jumps."""
        torque = reading.motor_torque if math.isfinite(reading.motor_torque) else 0.0
        self._reference.start(reading.ft, reading.velocity, desired)
        self._prediction.start(desired)
        self._state = State(ft=reading.ft, velocity=reading.velocity, newest=torque, applied=torque)
        self._begin = self._sent = torque
        self._known = (0.0, 0.0)
        self._age, self._desired = 0, desired
        self.share = Share()

    def step(
        self, reading: Reading, desired: float, missed: int = 0, *, late: bool = False, trust: float = 1.0
    ) -> float:
        """Return the torque (N m) that acts from the next sample on.

        desired: N m, at this sample, or two samples later with preview. missed: samples lost before it.
        late: the torque will act later than the margins allow; then it is feed-forward alone.
        trust: part of the feedback that counts, as lateness.py has it.
        """
        for wanted in np.linspace(self._desired, desired, missed + 2)[1:-1]:
            self._coast(float(wanted))
        ahead, model = self._ahead(desired), self._reference
        forward, reference = model.torque(ahead), float(model.now[FT])
        self._hear(reading, missed, reference - reading.ft)
        back, state = feedback(self._law, self._state, reference - reading.ft, reading.ft, reading.velocity)
        back = 0.0 if late else trust * back
        known, crossing = self._compensated(reading, forward), self._crossing(ahead)
        asked = forward + back + known + crossing
        torque = self._within(asked)
        self._remember(hold(state, torque - known), torque, known)
        model.advance(forward + torque - asked, float(ahead[0]))
        self.share = Share(reference, forward, back, known + crossing, torque, torque != asked)
        return torque

    def _ahead(self, desired: float) -> FloatArray:
        self._desired = desired
        samples = self._reference.samples
        return np.full(samples, desired) if self._preview else self._prediction.ahead(desired, samples)

    def _coast(self, desired: float) -> None:
        """Pass over a sample that did not come: the last torque goes on acting."""
        ahead = self._ahead(desired)
        self._reference.advance(self._reference.torque(ahead), float(ahead[0]))
        self._remember(hold(self._state, self._state.newest), self._sent, self._known[1])

    def _remember(self, state: State, torque: float, known: float) -> None:
        self._state = state
        self._sent, self._known = torque, (self._known[1], known)
        self._age += 1

    def _hear(self, reading: Reading, missed: int, error: float) -> None:
        """Take the measured motor torque for the one that acted; after lost samples, read those between."""
        s, share = self._state, missed / (missed + 1)
        acted = reading.motor_torque - self._known[0]
        self._state = s._replace(
            error=s.error + share * (error - s.error),
            ft=s.ft + share * (reading.ft - s.ft),
            velocity=s.velocity + share * (reading.velocity - s.velocity),
            applied=acted if math.isfinite(acted) else s.applied,
        )

    def _compensated(self, reading: Reading, forward: float) -> float:
        """Return the torque against friction and ripple, N m, of the motion that the model will make."""
        c, model = self._compensation, self._reference
        if not (c.frictions or c.ripples):
            return 0.0
        begin, end = model.next, model.after(forward)
        off = reading.position - float(model.now[POSITION])
        friction = c.friction(float(begin[VELOCITY]), float(end[VELOCITY]))
        return friction + c.ripple(off + float(begin[POSITION]), off + float(end[POSITION]))

    def _crossing(self, ahead: FloatArray) -> float:
        """Return J w' + b w of the way across the gap, N m, mean over the hold, by central differences."""
        c, h = self._compensation, self._law.period
        if not c.gap:
            return 0.0
        way = [c.way(float(torque)) for torque in (*self._reference.promised, ahead[0], ahead[1])]
        start, stop = 0.5 * (way[2] - way[0]) / h, 0.5 * (way[3] - way[1]) / h
        return self._law.inertia * (stop - start) / h + 0.5 * self._law.damping * (start + stop)

    def _within(self, torque: float) -> float:
        limits, before, h = self._limits, self._sent, self._law.period
        grown = min(1.0, (self._age + 1) * h / limits.ramp) if limits.ramp > 0.0 else 1.0
        torque = min(max(torque, before - limits.slew * h), before + limits.slew * h)
        largest = min(limits.torque, max(abs(self._begin), limits.torque * grown))
        return min(max(torque, -largest), largest)
