"""The torque controller: prediction, feed-forward, feedback, compensation and limits, one sample at a time.

    r      = where the desired torque will be when the command acts        prediction.py
    u_ff   = inverse of the held actuator, which runs one hold ahead, and  feedforward.py, reference.py
             what its load takes more, as far as it has been learned       learning.py
    u_fb   = PID on (torque of the model - ft), damping of the gear's
             speed about the model's, disturbance observer                 law.py
             and the measured motion of the link, in part                  link.py
    u_c    = friction, ripple, backlash, from the model's own motion       compensation.py
    u      = u_ff + u_fb + u_c within the limits

It needs no load: a rig's ends are not used. The torque that the limits remove is removed
from the model too, and integration stops at a limit. So nothing winds up, and the bench returns to the
desired torque as fast as the limits allow. A reading that is off its place in the grid of
samples is compared with the model at its own instant.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from rsea_ros.control.compensation import Compensation, compensation
from rsea_ros.control.law import FeedbackLaw, FeedbackState, Gains, feedback, hold, law_of, sample_rig
from rsea_ros.control.learning import Learning
from rsea_ros.control.link import LinkMotion, LinkShare
from rsea_ros.control.prediction import AHEAD, Acted, Prediction
from rsea_ros.control.reference import Reference
from rsea_ros.control.synthesis import design
from rsea_ros.control.uncertainty import lightest, load_range, lock
from rsea_ros.errors import check_kind, check_rate
from rsea_ros.model.rig import Rig, motor_torque
from rsea_ros.model.rig_limits import REACH
from rsea_ros.records.record import HUGE, NONSENSE, FloatArray, is_measured

CORNER = 80.0
"""Hz: what a desired torque does faster is not predicted. At 280 Hz 5 Hz are predicted within 0.9 %."""


@dataclass(frozen=True)
class TorqueLimits:
    """torque: N m, of the motor. slew: N m/s. ramp: s in which the limit grows after the start."""

    torque: float
    slew: float = 40_000.0
    ramp: float = 0.25

    @classmethod
    def of(cls, rig: Rig) -> TorqueLimits:
        """Return the limits of the motor that the rig states, else those of the paper's (`motor_torque`)."""
        return cls(motor_torque(rig)[0])


@dataclass(frozen=True)
class ControllerSettings:
    """How a controller uses its rig and the desired torque.

    compensate: effects of the rig to compensate; None: all that have a law for it. preview: the desired
    torque is known two samples ahead, so it is not predicted. corner: of the prediction, Hz. learn: learn
    load and drive; use False inside an outer loop whose desired torque follows the motion (virtual.py),
    because learning would change its impedance. velocity: measured; else it is that of the last positions.
    """

    compensate: tuple[str, ...] | None = None
    preview: bool = False
    corner: float = CORNER
    learn: bool = True
    velocity: bool = True


FOLLOWED = 0.25
"""Of the largest torque: the most that the link's motion may take."""
STALE = 0.05
"""s without a usable reading after which there is no torque; the next one starts anew."""
ERRING = 1.0
"""rad/s, by which encoders err. What is faster than REACH times what the motor's torque reaches was not
measured: one sample of 1000 rad/s took 68 N m for 0.1 s (decision 393)."""
SMALL = 0.01
"""Of the largest torque: an error at a start that is let in without teaching loads. For twice the ramp a
larger one would: 24 N m at the motor for 10 N m with a fifth of the samples lost."""


@dataclass(frozen=True)
class Measurement:
    """One sample of the bench: N m, rad/s, rad; motor_torque: N m, nan if unknown.

    The measured torque shows a command that came late or was cut down by the driver; whether it is that of
    the sample before or the new one already is learned (acted.py). ft_age: samples by which ft was taken
    before the rest; a sensor with a clock of its own sends when it likes.
    """

    ft: float
    velocity: float
    position: float
    motor_torque: float = math.nan
    ft_age: float = 0.0
    link: float = math.nan

    @property
    def is_whole(self) -> bool:
        """Whether ft and motion were measured: what no actuator has is no measurement."""
        return all(is_measured(value, HUGE) for value in (self.ft, self.velocity, self.position))


@dataclass(frozen=True)
class Share:
    """The parts of a command, N m; reference: the torque of the model at this sample."""

    reference: float = 0.0
    feedforward: float = 0.0
    feedback: float = 0.0
    compensation: float = 0.0
    command: float = 0.0
    limited: bool = False


class TorqueController:
    """Computes commands from readings and desired torques. A command acts one sample after its reading.

    Method: docs/control.md. Not to be confused with the node `controller`, which runs it on topics.
    """

    def __init__(
        self,
        rig: Rig,
        rate: float,
        gains: Gains | None = None,
        *,
        limits: TorqueLimits | None = None,
        link: LinkShare | None = None,
        settings: ControllerSettings | None = None,
    ) -> None:
        """rate: Hz. gains: by default those of `synthesis.design`, which takes 2 to 3 s.
        link: share of the motion in `Measurement.link` that is fed forward (link.link_share), by default
        nothing. Raises ParameterError for a rig whose torque cannot be controlled.
        """
        check_kind("rig", rig, Rig, "a Rig (rsea.load_rig)")
        check_rate(rate)
        self.rate, limits, link = rate, limits or TorqueLimits.of(rig), link or LinkShare()
        settings = settings or ControllerSettings()
        gains = gains or design(rig, load_range(rig, lightest(rig)), rate).gains
        self._law: FeedbackLaw = law_of(rig, rate, gains)
        self.learned = Learning(rig, self._law)
        self._reference = Reference(sample_rig(lock(rig), rate), self._law, self.learned)
        self._compensation: Compensation = compensation(rig, settings.compensate)
        self._prediction, self._acted = Prediction(settings.corner, 1.0 / rate), Acted(1.0 / rate)
        self._most = NONSENSE * max(limits.torque, 1.0)
        able, damping = max(limits.torque, motor_torque(rig)[0]), self._law.damping
        self._fastest = min(REACH * able / damping + ERRING, HUGE) if damping else HUGE
        self._preview, self._learn, self._limits = settings.preview, settings.learn, limits
        self._positions: list[float] | None = None if settings.velocity else []
        self._link = LinkMotion(self._law, link, FOLLOWED * limits.torque)
        self.start(Measurement(0.0, 0.0, 0.0))

    def start(self, reading: Measurement, desired: float = 0.0) -> None:
        """Restart without a jump, from the present state of the bench and its motor torque."""
        desired = desired if is_measured(desired, self._most) else 0.0
        torque = reading.motor_torque if is_measured(reading.motor_torque, self._most) else 0.0
        if self._positions is not None:
            self._positions = [reading.position] if is_measured(reading.position, HUGE) else []
            reading = replace(reading, velocity=0.0)
        if not self._is_usable(reading):
            reading = Measurement(0.0, 0.0, 0.0)
        softly = reading.ft if self._limits.ramp > 0.0 else desired
        self._skipped = 0
        self._reference.start(reading.ft, reading.velocity, softly)
        self.learned.start(reading.ft, reading.velocity)
        self._prediction.start(desired)
        self._link.start(reading.link)
        self._state = FeedbackState(ft=reading.ft, velocity=reading.velocity, newest=torque, applied=torque)
        self._acted.start(torque)
        self._begin = self._sent = self._sent_before = torque
        self._known = self._learned = (0.0, 0.0)
        self._age, self._crossed, self._jump = 0, 0.0, softly - desired
        self.share = Share()

    def limit(self, limits: TorqueLimits) -> None:
        """Keep other limits from the next sample on."""
        self._limits = limits

    def step(
        self,
        reading: Measurement,
        desired: float,
        missed: int = 0,
        *,
        trust: float = 1.0,
        offset: float = 0.0,
        desired_offset: float = 0.0,
    ) -> float:
        """Return the torque (N m) that acts from the next sample on.

        desired: N m, at this sample's place in the grid, or two samples later with preview. missed: samples
        lost before it. offset: samples by which the reading was taken after its place in the grid.
        A reading with a value that is not measured, or beyond NONSENSE times the largest torque, is a lost
        sample, as with a trust or an offset that is no number; for such a desired torque the one that was
        expected counts.
        desired_offset: samples by which desired is for later than that place; with preview it does not count.
        trust: part of the feedback that counts, as lateness.py has it; with 0 it is feed-forward alone.
        """
        if not is_measured(desired, self._most):
            desired = self._prediction.expected(missed + 1)
        if self._positions is not None:
            reading = replace(reading, velocity=self._derived(reading.position, missed + self._skipped))
        if not (self._is_usable(reading) and math.isfinite(trust + offset + desired_offset)):
            return self._bridge(missed)
        if self._skipped * self._law.period > STALE:
            self.start(reading, desired)
            missed = 0
        missed, self._skipped = missed + self._skipped, 0
        if not is_measured(reading.motor_torque, self._most):
            reading = replace(reading, motor_torque=math.nan)
        for wanted in self._prediction.between(desired, missed) if missed else ():
            self._coast(wanted, desired_offset)
        ahead, model = self._ahead(desired, desired_offset), self._reference
        most, limit = self._limits.slew * self._law.period, self._limits.torque
        largest = min(limit, abs(self._begin) + limit * self._grown())
        forward = min(max(model.torque(ahead), -largest), largest)
        more, lead, learned = model.more(forward)
        more = min(max(more, -largest - forward), largest - forward)
        error, slowness, reading = self._compare(reading, offset)
        self._hear(reading, missed, error, slowness, in_time=trust == 1.0)
        back, state = feedback(self._law, self._state, error, slowness, reading.ft, reading.velocity)
        back += self._link.torque(reading.link, model.yield_speed, missed, offset)
        back *= trust
        compensated, crossing = self._compensating_torque(reading, forward), self._crossing(ahead)
        known = learned + compensated
        whole = forward + more + back + lead + compensated + crossing
        torque = min(max(min(max(whole, self._sent - most), self._sent + most), -largest), largest)
        if (whole - torque) * error > 0.0:
            state = state._replace(slow=self._state.slow, integral=self._state.integral)
        self._remember(hold(state, torque - known), torque, known, learned)
        self.share = Share(
            float(model.now[0]), forward + more, back, lead + compensated + crossing, torque, torque != whole
        )
        model.advance(forward, float(ahead[0]))
        return torque

    def _derived(self, position: float, missed: int) -> float:
        """Return an encoder's velocity, rad/s: where the last three positions are known, without a lag."""
        known, h = self._positions or [], self._law.period
        if not is_measured(position, HUGE):
            return math.nan
        self._positions = [position, *known[:1]] if not missed else [position]
        if missed or len(known) < 2:
            return (position - known[0]) / (h * (missed + 1)) if known else 0.0
        return (3.0 * position - 4.0 * known[0] + known[1]) / (2.0 * h)

    def _is_usable(self, r: Measurement) -> bool:
        bounds = (r.ft, self._most), (r.velocity, self._fastest), (r.position, HUGE), (r.ft_age, HUGE)
        return all(is_measured(value, most) for value, most in bounds)

    def _bridge(self, missed: int) -> float:
        """Return the torque, N m, for a sample that says nothing: the last one, zero once it is stale."""
        self._skipped += missed + 1
        if self._skipped * self._law.period > STALE:
            self._sent = 0.0
        return self._sent

    def _ahead(self, desired: float, off: float) -> FloatArray:
        samples = self._reference.samples
        if self._preview:
            return self._soften(np.full(samples, desired))
        return self._soften(self._prediction.ahead(desired, samples, off))

    def _coast(self, desired: float, off: float) -> None:
        """Bridge a missing sample: the last torque goes on acting."""
        ahead = self._ahead(desired, off)
        self._reference.advance(self._reference.torque(ahead), float(ahead[0]))
        self._remember(hold(self._state, self._state.newest), self._sent, self._known[1], self._learned[1])

    def _remember(self, state: FeedbackState, torque: float, known: float, learned: float) -> None:
        self._state = state
        self._sent_before, self._sent, self._known = self._sent, torque, (self._known[1], known)
        self._learned = self._learned[1], learned
        self._age += 1

    def _compare(self, reading: Measurement, offset: float) -> tuple[float, float, Measurement]:
        """Return how far the model is ahead in torque (N m) and speed (rad/s), and the reading at its place.

        Both are compared at one instant: torque at that of ft, speed at that of the other measurements.
        """
        model = self._reference
        torque, speed = model.at(offset - reading.ft_age)[0], model.at(offset)[1]
        ft, velocity = model.at(0.0)
        speed += self._crossed
        velocity += self._crossed
        placed = replace(reading, ft=reading.ft - torque + ft, velocity=reading.velocity - speed + velocity)
        return torque - reading.ft, speed - reading.velocity, placed

    def _hear(
        self, reading: Measurement, missed: int, error: float, slowness: float, *, in_time: bool
    ) -> None:
        """Learn from a sample, and take the measured motor torque for the one that acted.

        After lost samples, those between are read on a straight line.
        """
        s, turned = self._state, reading.velocity - self._state.velocity
        share, timely = missed / (missed + 1), in_time and not missed
        acted = self._acted.over_sample(reading.motor_torque, self._sent_before, self._sent, sure=timely)
        acted = acted - self._known[0] if math.isfinite(acted) else s.applied
        still = abs(self._jump) < SMALL * self._limits.torque or self._grown(-self._age // 2) >= 1.0
        for part in np.linspace(0.0, 1.0, missed + 2)[1:].tolist() if missed else (1.0,):
            ft, velocity = s.ft + part * (reading.ft - s.ft), s.velocity + part * turned
            torques = s.applied + self._learned[0], acted + self._learned[0]
            sure = self._learn and in_time and still
            self.learned.hear(ft, velocity, *torques, gap=self._crossed, sure=sure)
        self._state = s._replace(
            error=s.error + share * (error - s.error),
            slowness=s.slowness + share * (slowness - s.slowness),
            ft=s.ft + share * (reading.ft - s.ft),
            velocity=s.velocity + share * turned,
            applied=acted,
        )

    def _compensating_torque(self, reading: Measurement, forward: float) -> float:
        """Return the torque against friction and ripple, N m, of the motion that the model will make."""
        c, model = self._compensation, self._reference
        if not (c.frictions or c.ripples):
            return 0.0
        speeds, angles = model.motion(forward)
        off = reading.position - model.angle
        return c.friction(*speeds) + c.ripple(off + angles[0], off + angles[1])

    def _crossing(self, ahead: FloatArray) -> float:
        """Return J w' + b w of the way across the gap, N m, mean over the hold, by central differences."""
        c, h = self._compensation, self._law.period
        if not c.gap:
            return 0.0
        way = [c.way(float(torque)) for torque in (*self._reference.promised, ahead[0], ahead[1])]
        start, stop = 0.5 * (way[2] - way[0]) / h, 0.5 * (way[3] - way[1]) / h
        self._crossed = start
        return self._law.inertia * (stop - start) / h + 0.5 * self._law.damping * (start + stop)

    def _grown(self, ahead: int = 0) -> float:
        """Return the part of the limits that is open at this sample or later ones: it grows after a start."""
        ramp = self._limits.ramp
        return min(1.0, (self._age + 1 + ahead) * self._law.period / ramp) if ramp > 0.0 else 1.0

    def _soften(self, ahead: FloatArray) -> FloatArray:
        """Return desired torques, N m, without the error of the start, which is let in over the ramp.

        A limit on the torque alone lets the whole error in at once, which takes several times its size.
        """
        if self._grown(AHEAD) >= 1.0:
            return ahead
        left = 1.0 - np.array([self._grown(AHEAD + k) for k in range(len(ahead))])
        softened: FloatArray = ahead + self._jump * left * left * (3.0 - 2.0 * left)
        return softened
