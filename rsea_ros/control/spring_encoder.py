"""The link's angle from the encoder on the spring, as long as that agrees with the torque.

    link = position - deflection,      g = deflection - T / (K_s + b_s s)

`ft` and the encoder measure the spring twice. An encoder that is frozen, that jumps, or of the wrong sign or
scale is off by as much as the spring moves: then no angle is returned. It counts only after it has agreed for
a while in which the spring moved, so none makes a torque before it has been seen to be right.
"""

import math
from dataclasses import dataclass

from rsea_ros.control.learning import Stretch
from rsea_ros.model.rig import Rig

SIGMAS = 8.0
"""Standard deviations of g by which it may be off, beside PART of what the spring moves."""
PART = 0.5
"""A frozen encoder is off by 1, one of the wrong sign by 2, one sample at 10 Hz and 280 Hz by 0.2."""
CONFIRM = 0.25
"""s of agreement while the spring moves, after which it counts."""
MOVES = 3.0
"""Times the allowance at rest that the spring must move for that."""
SLOW = 0.5
"""s, over which g and T / K_s may drift: the encoder's zero, a creep."""
PAUSE = 0.1
"""s without a usable deflection after which agreement must be seen anew."""
REPEATS = 10
"""Equal samples that are no chance while the position moves."""


@dataclass(frozen=True)
class SpringReading:
    """deflection, position: rad. ft: N m. age, ft_age: samples by which deflection and ft were taken before
    the position. periods: since the reading before."""

    deflection: float
    ft: float
    position: float
    age: float = 0.0
    ft_age: float = 0.0
    periods: float = 1.0


class SpringEncoder:
    """used: whether the angle counts. missing: readings without. losses: how often it ceased to count."""

    def __init__(self, rig: Rig, rate: float) -> None:
        """rate: Hz."""
        stiffness = rig["spring.stiffness"]
        self._stretch = Stretch(stiffness, rig["spring.damping"], 1.0 / rate)
        self._floor = SIGMAS * math.hypot(spread(rig, "deflection"), spread(rig, "ft") / stiffness)
        self._period, self._compliance = 1.0 / rate, 1.0 / stiffness
        self._clock = float(rig.clock("deflection"))
        self.missing = self.losses = 0
        self.trouble = ""
        self.used = False
        self._agreed = self._silent = self._peak = self._step = 0.0
        self._phi = self._mean_phi = self._off = self._mean_off = self._last = self._where = math.nan
        self._same = 0

    def link(self, r: SpringReading) -> float:
        """Return the link's angle against the housing, rad; nan while it does not count."""
        if not 0.0 < r.periods * self._period < PAUSE:
            self._lose("")
        rate = self._follow(r.ft)
        deflection = r.deflection + (r.age * self._period - self._clock) * rate
        if not math.isfinite(deflection):
            self._miss(r.periods)
            return math.nan
        self._silent = 0.0
        off = deflection - r.ft_age * self._period * rate - self._phi
        if trouble := self._trouble(r, off, rate * self._period):
            self._lose(trouble)
            return math.nan
        if self._peak > MOVES * self._floor:
            self._agreed += r.periods * self._period
        if self._agreed >= CONFIRM:
            self.used, self.trouble = True, ""
        return r.position - deflection if self.used else math.nan

    def _follow(self, ft: float) -> float:
        """Return the rate of the spring, rad/s, by the torque."""
        if not math.isfinite(self._phi):
            self._stretch.start(ft)
            self._phi = self._mean_phi = ft * self._compliance
        rate = self._stretch.rate(ft)
        self._phi += rate * self._period
        return rate

    def _trouble(self, r: SpringReading, off: float, step: float) -> str:
        """Return in words why a deflection is wrong; empty for a sound one."""
        if not math.isfinite(self._off):
            self._off = self._mean_off = off
        share = self._period / SLOW
        self._mean_phi += share * (self._phi - self._mean_phi)
        self._mean_off += share * (off - self._mean_off)
        self._peak = max(abs(self._phi - self._mean_phi), (1.0 - share) * self._peak)
        self._step = max(abs(step), (1.0 - share) * self._step)
        jump, self._off = abs(off - self._off), off
        if self._repeats(r):
            return "deflection does not change"
        drift = abs(off - self._mean_off)
        if jump > self._floor + PART * self._step or drift > self._floor + PART * self._peak:
            return "deflection does not agree with ft"
        return ""

    def _repeats(self, r: SpringReading) -> bool:
        if r.deflection != self._last:
            self._last, self._where, self._same = r.deflection, r.position, 0
        self._same += 1
        return self._same >= REPEATS and abs(r.position - self._where) > MOVES * self._floor

    def _miss(self, periods: float) -> None:
        self.missing += 1
        self._silent += periods * self._period
        if self._silent > PAUSE:
            self._lose("no deflection")

    def _lose(self, trouble: str) -> None:
        self.losses += self.used
        self.used, self.trouble = False, trouble
        self._agreed = self._silent = self._peak = self._step = 0.0
        self._phi = self._off = self._last = math.nan


def spread(rig: Rig, channel: str) -> float:
    """Return the standard deviation of a sensor's noise with its quantum; 0 where the rig has no sensor."""
    sensor = rig.sensors.get(channel)
    return sensor.level if sensor else 0.0
