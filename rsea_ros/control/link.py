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
from rsea_ros.control.margins import distal_responses, encirclements, link_response, returns
from rsea_ros.control.synthesis import SOFT, ControllerDesign, DesignLimits, grid
from rsea_ros.control.uncertainty import corners, family
from rsea_ros.model.rig import Rig
from rsea_ros.records.record import BoolArray, ComplexArray, FloatArray

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
