"""The load's motion fed forward from an encoder on the link, as far as the whole set of benches lets it.

    u = Q (p_J J_m w_l' + p_b b_m w_l),   Q = 1 / (1 + s / w_c),   w_l: the link's speed against the housing

less what the load has been learned to do for the desired torque (learning.py), which is fed forward in full.
A link that someone else moves is a disturbance that is measured, no feedback. With a free load it is one: the
torque moves the load, which moves the encoder. In full (p_J = p_b = 1) the actuator would have neither
inertia nor drag for the load, and any lag would swing a pendulum up: the parts are the largest of a list for
which every bench of the set keeps the largest sensitivities of the design.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product

import numpy as np

from rsea_ros.control.law import LINK, FeedbackLaw, law_of
from rsea_ros.control.learning import Stretch
from rsea_ros.control.margins import distal_responses, encirclements, link_response, returns
from rsea_ros.control.synthesis import SOFT, ControllerDesign, DesignLimits, grid
from rsea_ros.control.uncertainty import corners, family
from rsea_ros.model.rig import Rig
from rsea_ros.records.record import BoolArray, ComplexArray, FloatArray

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
    """The link's angle from the encoder on the spring, as long as that agrees with the torque.

        link = position - deflection,      g = deflection - T / (K_s + b_s s)

    `ft` and the encoder measure the spring twice. An encoder that is frozen, that jumps, or of the wrong sign
    or scale is off by as much as the spring moves: then no angle is returned. It counts only after it has
    agreed for a while in which the spring moved, so none makes a torque before it has been seen to be right.

    used: whether the angle counts. missing: readings without. losses: how often it ceased to count.
    """

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


INERTIAS, DAMPINGS = (0.0, 0.25, 0.5, 0.75, 1.0), (0.0, 0.2, 0.4)
"""Parts of J_m and b_m that are tried. Half of b_m is the least that a bench of the set has."""
CORNERS = (5.0, 8.0, 12.0, 20.0, 30.0, 50.0)
"""Hz, of Q."""
SOFTEST = (*SOFT, 5.0, 10.0)
"""Hz, at which the output should be soft."""
BRIDGED = 2
"""Samples between two angles that give a speed; after a longer gap it is unknown, not the mean."""
MORE = 1.02
"""Of a demand: as far as the search of the gains comes as well."""


@dataclass(frozen=True)
class LinkShare:
    """inertia, damping: parts of J_m and b_m that are fed forward. corner: of Q, Hz."""

    inertia: float = 0.0
    damping: float = 0.0
    corner: float = CORNERS[0]


class LinkMotion:
    """Follows the link's speed that the desired torque does not explain, one sample at a time."""

    def __init__(self, law: FeedbackLaw, share: LinkShare, most: float = math.inf) -> None:
        """most: N m, the largest torque; an encoder that jumps must not make more."""
        self._inertia, self._damping = share.inertia * law.inertia, share.damping * law.damping
        self._period, self._most = law.period, most
        self._pole = math.exp(-2.0 * math.pi * share.corner * law.period)
        self.start(math.nan)

    def start(self, angle: float | None) -> None:
        """Begin at an angle of the link against the housing, rad, of unknown speed; nan, None: not known."""
        self._angle = math.nan if angle is None else angle
        self._speed, self._torque, self._since = math.nan, 0.0, 0

    def torque(self, angle: float | None, expected: float, missed: int = 0, offset: float = 0.0) -> float:
        """Return the torque, N m, for the motion of the sample that ends.

        angle: rad; nan, None: not measured, and the torque fades. expected: rad/s, the learned load's speed.
        missed: samples that were lost before. offset: samples by which the angle was read after its place.
        """
        self._since, wanted = self._since + 1 + missed, 0.0
        moving = self._speed if math.isfinite(self._speed) else 0.0
        placed = (math.nan if angle is None else angle) - offset * self._period * (moving + expected)
        if math.isfinite(placed):
            if math.isfinite(self._angle) and self._since <= BRIDGED:
                time = self._since * self._period
                speed = (placed - self._angle) / time - expected
                before = self._speed if math.isfinite(self._speed) else speed
                rise, mean = (speed - before) / time, 0.5 * (speed + before)
                wanted, self._speed = self._inertia * rise + self._damping * mean, speed
            else:
                self._speed = math.nan
            self._angle, self._since = placed, 0
        wanted = min(max(wanted, -self._most), self._most)
        self._torque += (1.0 - self._pole) * (wanted - self._torque)
        return self._torque


@dataclass(frozen=True)
class LinkedSet:
    """The benches of the set with the link's motion fed forward. hz: shape (n,). path, memory, alone, the
    link's response to the command: shape (m, n); memory, alone: of `loop.returns`."""

    law: FeedbackLaw
    hz: FloatArray
    nominal: BoolArray
    path: ComplexArray
    link: ComplexArray
    memory: ComplexArray
    alone: ComplexArray

    def whole(self, share: LinkShare) -> ComplexArray:
        """Return 1 + L with a share, shape (m, n)."""
        return self.alone - self.path * self.on_link(share) * self.link

    def on_link(self, share: LinkShare) -> ComplexArray:
        """Return the torque for the angle of the link, N m/rad, shape (n,)."""
        return link_response(self.law, share.inertia, share.damping, share.corner, self.hz)

    def sensitivity(self, share: LinkShare) -> FloatArray:
        """Return the largest sensitivity of each bench, shape (m,)."""
        peaks: FloatArray = (np.maximum(np.abs(self.memory), 1.0) / np.abs(self.whole(share))).max(axis=1)
        return peaks


def linked_set(rig: Rig, loads: Mapping[str, Rig], design: ControllerDesign) -> LinkedSet:
    """Return the corners of the set with every load."""
    law, hz = law_of(rig, design.rate, design.gains), grid(design.rate, 60)
    f = family(loads, corners(tuple(loads), design.uncertainty), design.rate, hz)
    memory, alone = returns(law, f.plant, hz, f.path, f.current)
    return LinkedSet(law, hz, f.nominal, f.path, f.plant[LINK], memory, alone)


def link_share(
    rig: Rig, loads: Mapping[str, Rig], design: ControllerDesign, demand: DesignLimits | None = None
) -> LinkShare:
    """Return the parts that make the output softest with every bench of the set as robust as demanded."""
    demand, benches = demand or DesignLimits(), linked_set(rig, loads, design)
    still = distal_responses(rig, design.rate, benches.hz)
    demanded = MORE * np.where(benches.nominal, demand.sensitivity, demand.robust)
    allowed = np.maximum(demanded, benches.sensitivity(LinkShare()))
    best, softest = LinkShare(), math.inf
    for share in (LinkShare(*parts) for parts in product(INERTIAS, DAMPINGS, CORNERS)):
        ratio = still.ratio(benches.law, benches.on_link(share))
        soft = float(np.mean(np.log(np.interp(SOFTEST, benches.hz, ratio))))
        robust = (benches.sensitivity(share) <= allowed).all()
        robust = robust and (encirclements(benches.whole(share)) < 0.5).all()
        if robust and soft < softest and ratio.max() <= MORE * demand.impedance:
            best, softest = share, soft
    return best
