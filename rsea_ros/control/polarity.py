"""Pulses of torque that prove the signs of F/T sensor, position and motor torque before feedback acts.

A wrong sign in a sensor or the drive makes feedback run away. So there is no torque before the first desired
one, and then pulses without feedback, either way, until the right signs explain the readings much better
than any wrong ones (sign_evidence.py), or much worse: a contradiction. While feedback acts the momentum of
the gear is checked sample by sample: a sign that changes is off by twice the torque, which no load and no
gear does.
"""

from __future__ import annotations

import math

from rsea_ros.control.controller import Measurement
from rsea_ros.control.sign_evidence import DOUBT, MOVED, POWER, RIGHT, SIGNS, SWAY, SignChange, SignEvidence
from rsea_ros.model.rig import Rig
from rsea_ros.records.record import HUGE, is_measured

PULSE, PART = 4.0, 0.06
"""N m of a pulse beyond the torque at which the gear breaks away; part of the torque limit that it is at
most."""
ENOUGH, FURTHEST = 0.8, 2.0
"""Of PULSE, beyond where the gear broke away: first pulses, and those on which the signs stay open."""
BROKEN = 0.025
"""Of PULSE, by which the gear has moved the spring where it has broken away."""
STIFFEST = 0.3
"""Of the torque limit: what pulses reach, PULSE more each time, on a gear that does not move."""
RISE = 0.1
"""s in which a pulse rises by PULSE."""
REST, LONGEST_REST = 0.1, 0.5
"""s of rest before a pulse; and after which it comes although the load moves."""
LOUD = 0.05
"""Of PULSE: RMS of what is no rest."""
SURE, SHAKEN = 8.0, 3.0
"""Half the difference of two sums of squares over their variance: e^8 to 1. Times that, for a contradiction
where something else moves the load."""
CYCLES = 2
"""Of contradiction in a row that are a fault."""
SUDDEN, LONG = 1.25, 2.0
"""Of PULSE, beside twice the friction of the last LONG s, by which the momentum may be off at once."""
EXPLAINED = 0.4
"""Of that, what a changed sign may leave of it."""
SENT = 4
"""Commands that a measured motor torque may belong to."""
FROZEN, STUCK = 0.02, 0.5
"""s for which joint_states repeat one value, and of PULSE what they should have followed meanwhile."""
TIMES = 2.5
"""Times the command that the motor torque may be."""
REVERSED = {
    SIGNS[1]: "joint_states are reversed",
    SIGNS[2]: "ft is reversed",
    SIGNS[3]: "motor torque is reversed",
}


class Polarity:
    """Pulses until the signs are proven, then watches them.

    proven: whether feedback may act. contradiction: in words, empty without one. doubted: whether the ft of
    the last reading is no torque.
    """

    def __init__(self, rig: Rig, rate: float, limit: float) -> None:
        """rate: Hz. limit: the largest torque, N m."""
        self._h, self._pulse = 1.0 / rate, min(PULSE, PART * limit)
        self._stiffness = rig["spring.stiffness"]
        self._stiffest = max(self._pulse, STIFFEST * limit)
        self._seen = SignEvidence(rig, rate, self._pulse)
        self._change = SignChange(rig, rate, (self._seen.ft_noise, self._seen.noise), self._pulse)
        self._calm = max(LOUD * self._pulse, 3.0 * self._seen.ft_noise)
        self.start()

    def start(self) -> None:
        """Forget everything: nothing is proven."""
        self._seen.start()
        self.proven, self.contradiction, self.doubted, self._unheard = False, "", False, 0
        self._sent, self._made = [0.0] * SENT, [0.0] * SENT
        self._friction, self._off, self._alike = 0.0, 0, 0
        self._state, self._asked = (0.0, 0.0, 0.0), (0.0, 0.0)
        self._change.start()
        self._direction, self._level, self._beyond = -1.0, self._pulse, ENOUGH * self._pulse
        self._pulsing, self._back, self._full, self._torque = False, False, False, 0.0
        self._rested = self._broke = 0.0

    def probe(
        self, reading: Measurement, desired: float | None, missed: int = 0, *, acts: bool = True
    ) -> float | None:
        """Return the torque, N m, that acts from the next sample on; None once the signs are proven.

        desired: N m; None: no torque was ever desired, and there is none. missed: samples lost before.
        acts: whether its command can act; of samples that wait together only the newest one's can, and a
        pulse that went on in the others would be ahead of the motor, which still makes the one before.
        """
        self._seen.hear(reading, self._sent[1], missed)
        torque = 0.0 if desired is None else self._next() if acts else self._sent[0]
        if self._pulsing:
            self._decide()
        if self.proven:
            return None
        torque = 0.0 if self.contradiction else torque
        self.sent(torque)
        return torque

    def sent(self, torque: float) -> None:
        """Note the torque, N m, that acts from the next sample on."""
        self._sent = [torque, *self._sent[:-1]]

    def watch(self, reading: Measurement, missed: int = 0) -> str:
        """Return a contradiction under torque, in words; empty without one. It sets doubted."""
        jump = self._change.jump(reading, missed)
        self.doubted, lost = jump != 0.0, missed + self._unheard
        self._unheard = lost + 1 if self.doubted else 0
        heard = None if self.doubted else self._seen.hear(reading, self._sent[1], lost, keep=False)
        self._made = [self._seen.made[1], *self._made[:-1]]
        made = reading.motor_torque if is_measured(reading.motor_torque, HUGE) else math.inf
        before, self._state = self._state, (reading.position, reading.velocity, made)
        self._alike = self._alike + 1 if self._state == before else 0
        left_behind = self._left_behind(reading)
        if self._alike * self._h > FROZEN and left_behind > STUCK * self._pulse:
            self._contradict("joint_states repeat one value")
        if self.contradiction:
            return self.contradiction
        rest = None if heard is None else self._made[0] - sum(heard)
        if words := self._change.take(reading, rest, missed, jump):
            self._contradict(self._unless_frozen(words))
        if heard is None or self.contradiction:
            return self.contradiction
        ft, motion = heard
        off = self._outside(ft + motion)
        flipped = {
            "ft": self._outside(motion - ft),
            "joint_states": self._outside(ft - motion),
            "motor torque": self._outside(-ft - motion),
        }
        name = min(flipped, key=lambda each: flipped[each])
        allowed = SUDDEN * self._pulse + 2.0 * self._friction + DOUBT * abs(motion) + 4.0 * self._seen.noise
        self._off = self._off + 1 if off > allowed and flipped[name] < EXPLAINED * off else 0
        self._friction += self._h / LONG * (min(off, allowed) - self._friction)
        if self._off >= CYCLES:  # two samples do not tell a sign from a gain
            torques = f"motor torque is {self._made[0]:.3g} N·m, ft {ft:.3g}, J w' + b w {motion:.3g}"
            self._contradict(self._unless_frozen(f"{torques}, as with another gain or with {name} reversed"))
        return self.contradiction

    def _left_behind(self, reading: Measurement) -> float:
        """Return what repeating states did not follow, N m: motor torque its command, position its velocity.

        Without a motor torque a gear that sticks is right, as far as ft and friction hold the command.
        """
        acted = [self._sent[-1], *(self._asked if self._alike else ())]
        self._asked = min(acted), max(acted)
        asked = self._asked[1] - self._asked[0]
        if not is_measured(reading.motor_torque, HUGE):
            ft = reading.ft if is_measured(reading.ft, HUGE) else 0.0
            asked = min(asked, abs(self._sent[-1] - ft) - 2.0 * self._friction)
        return max(asked, self._stiffness * abs(reading.velocity) * self._alike * self._h)

    def _unless_frozen(self, words: str) -> str:
        """Return words on what changed; a signal that stands still beside one that moves looks so, too."""
        return words if self._alike < CYCLES else "joint_states repeat one value"

    def _outside(self, torque: float) -> float:
        """Return by how much a torque is outside of what the motor made over the last SENT samples, N m.

        A drive filters its velocity and measures its torque at another instant (decision 260).
        """
        return max(min(self._made) - torque, torque - max(self._made), 0.0)

    def _contradict(self, words: str) -> None:
        self.contradiction = (
            f"signs: {words}; ft, joint_states and motor torque contradict each other, expected ft positive"
            " where the spring pushes the distal side forward, position and motor torque positive forward"
        )

    def _next(self) -> float:
        """Return the next torque of the pulses."""
        if self._pulsing:
            return self._fall() if self._back else self._grow()
        self._rested += self._h
        calm = self._seen.heard > SWAY and self._seen.unrest < self._calm
        if (self._rested > REST and calm) or self._rested > LONGEST_REST:
            self._seen.begin_pulse()
            self._direction *= -1.0
            self._pulsing, self._back, self._full, self._broke = True, False, False, 0.0
        return 0.0

    def _grow(self) -> float:
        if self._seen.way < max(BROKEN * self._pulse, self._seen.unseen):
            self._broke = abs(self._torque)
        before = abs(self._torque)
        self._torque += self._direction * self._pulse * self._h / RISE
        size = abs(self._torque)
        self._full = size >= self._broke + self._beyond
        self._back = self._full or (size >= self._level and self._broke == before)
        if self._back and abs(self._seen.made[1]) > 0.5 * size:  # a drive that is off learns nothing
            self._level = min(self._level + self._pulse, self._stiffest)
            self._beyond = min(self._beyond + 0.25 * self._pulse * self._full, FURTHEST * self._pulse)
        return self._torque

    def _fall(self) -> float:
        step = 2.0 * self._pulse * self._h / RISE
        self._torque -= self._direction * min(step, abs(self._torque))
        if self._torque == 0.0:
            self._seen.end_pulse()
            self._pulsing, self._rested = False, 0.0
        return self._torque

    def _decide(self) -> None:
        """Compare how well right and wrong signs explain what came."""
        if max(abs(torque) for torque in self._sent) < MOVED * self._pulse:
            return
        fit, power = self._seen.misfits(), self._seen.powers()
        whole = {signs: fit[signs] + power[signs] for signs in SIGNS}
        best = min(SIGNS[1:], key=lambda signs: whole[signs])
        decisive = any(power.values())
        needed = SURE if decisive else SHAKEN * SURE
        agree = fit[best] - fit[RIGHT] < 0.5 * SURE and (power[RIGHT] >= POWER or not decisive)
        if words := self._seen.turned():
            self._contradict(words)
        elif whole[RIGHT] - whole[best] > needed and agree:
            self._contradict(REVERSED[best])
        elif words := self._wrong_drive() or self._seen.wrong_size():
            self._contradict(words)
        elif whole[best] - whole[RIGHT] > SURE and (self._full or self._seen.size_is_known()):
            self.proven, self._friction = True, max(self._broke, self._seen.friction())

    def _wrong_drive(self) -> str:
        """Return in words that the motor torque is not that of the command; empty where it may be.

        A motor whose driver limits the torque, or is off, makes less.
        """
        most, made = max(abs(torque) for torque in self._sent), self._seen.made
        if min(abs(torque) for torque in made) > TIMES * most + self._pulse:
            return f"motor torque is {made[1]:.3g} N·m at a command of at most {most:.3g} N·m"
        if not self._back and all(torque * self._direction < -0.25 * self._pulse for torque in made):
            return REVERSED[SIGNS[3]]
        return ""
