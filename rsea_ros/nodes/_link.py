"""What a controller measures: the actuator's topics and the link's motion."""

import math
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from rclpy.node import Node

from msg_adapters.topic_map import JOINT_STATE, WRENCH, sign_and_index
from rsea_ros.control.compensation import compensation
from rsea_ros.control.controller import Measurement
from rsea_ros.control.law import law_of
from rsea_ros.control.link import LinkMotion, LinkShare, link_share
from rsea_ros.control.spring_encoder import SpringEncoder, SpringReading, spread
from rsea_ros.control.synthesis import ControllerDesign, DesignLimits
from rsea_ros.control.uncertainty import lightest, load_range
from rsea_ros.model.rig import Rig
from rsea_ros.model.rig_file import load_rig
from rsea_ros.nodes._commands import CommandQueue, Obeyed
from rsea_ros.nodes._cycle import Anchor
from rsea_ros.nodes._mailbox import Mailbox, MessageFields
from rsea_ros.nodes._qos import COMMAND, MEASUREMENT
from rsea_ros.records.record import HUGE, NONSENSE, is_measured

LOUD = 0.02
"""Of torque_limit: RMS of the torque that the noise of both encoders may make."""
HEARD = 2000
"""Samples of noise that show it."""


class LinkFeedforward(NamedTuple):
    """share: what is fed forward. encoder: None where nothing is, and `reason` says why."""

    share: LinkShare
    encoder: SpringEncoder | None
    reason: str


def link_of(values: Mapping[str, Any], designed: ControllerDesign) -> LinkFeedforward:
    """Return what the link's motion is used for."""
    rig = load_rig(values["rig"])
    if reason := _unusable(values, rig):
        return LinkFeedforward(LinkShare(), None, reason)
    demand = DesignLimits(*(values[name] for name in ("sensitivity", "robust", "impedance")))
    share = link_share(rig, load_range(rig, lightest(rig, values["free"])), designed, demand)
    if share == LinkShare():
        return LinkFeedforward(share, None, "no part of it keeps the demands")
    loud, most = _noise(rig, designed, share), LOUD * values["torque_limit"]
    if loud > most:
        reason = f"noise of {loud:.2g} N·m of motor torque, expected at most {most:.2g}"
        return LinkFeedforward(LinkShare(), None, reason)
    return LinkFeedforward(share, SpringEncoder(rig, designed.rate), "")


def link_words(link: LinkFeedforward) -> str:
    """Return it as a line for the log."""
    if link.encoder is None:
        return f"motion of the link is not fed forward: {link.reason}"
    s = link.share
    return (
        f"motion of the link is fed forward once deflection agrees with ft: {s.inertia:g} of the inertia,"
        f" {s.damping:g} of the damping, below {s.corner:g} Hz"
    )


def link_values(link: LinkFeedforward) -> dict[str, object]:
    """Return it as diagnostics show it."""
    encoder = link.encoder
    if encoder is None:
        return {"link": f"not used: {link.reason}"}
    waiting = f"not used: {encoder.trouble or 'deflection and ft have not been compared in motion yet'}"
    return {
        "link": "used" if encoder.used else waiting,
        "link_losses": encoder.losses,
        "missing_deflections": encoder.missing,
    }


def _unusable(values: Mapping[str, Any], rig: Rig) -> str:
    if not values["link"]:
        return "link is false"
    if "deflection" not in rig.sensors:
        return "the rig has no sensor deflection"
    if compensation(rig).gap:
        return "the rig has backlash, which looks like motion of the link"
    return ""


def _noise(rig: Rig, designed: ControllerDesign, share: LinkShare) -> float:
    """Return the RMS of the torque of a link that stands still, N m."""
    angle = math.hypot(spread(rig, "deflection"), spread(rig, "position"))
    motion = LinkMotion(law_of(rig, designed.rate, designed.gains), share)
    torques = [motion.torque(angle * x, 0.0) for x in np.random.default_rng(0).normal(size=HEARD)]
    return math.sqrt(sum(torque**2 for torque in torques) / HEARD)


WAITING = 500
"""Measurements that wait for their other half."""

OLD = 1.5
"""Samples: what is older than the sample before is no deflection of a reading."""

MOST = 100
"""Desired torques that are taken at once."""


class Measurements:
    """Pairs of joint_states and ft, with the link's angle. period: ns. desired: messages of desired_torque.

    encoder: checks `deflection`; None: that topic is not heard.
    limit: the largest torque, N m.
    unusable: readings that were not finite, or of NONSENSE times the limit, and messages of several joints.
    senders: of each topic, of which one at a time is heard.
    """

    def __init__(
        self, node: Node, axis: str, period: float, joint: str = "", *,
        encoder: SpringEncoder | None = None, limit: float = math.inf,
    ) -> None:  # fmt: skip
        self._period = period
        self._sign, along = sign_and_index(axis)
        self._waiting_states: deque[tuple[int, Sequence[float]]] = deque(maxlen=WAITING)
        self._waiting_fts: deque[tuple[int, float]] = deque(maxlen=WAITING)
        self.desired, self._most = CommandQueue(limit=limit), NONSENSE * limit
        self.unusable = self._heard = 0
        self.senders = {what: Obeyed() for what in ("joint_states", "wrenches", "desired torques")}
        admit = {what: sender.admit for what, sender in self.senders.items()}
        state = (("position", 0), ("velocity", 0), ("effort", 0))
        states = MessageFields(JOINT_STATE, state, joint)
        self._states = Mailbox(
            node, "joint_states", states, MEASUREMENT, self._refuse, admit=admit["joint_states"]
        )
        wrench = MessageFields(WRENCH, (("wrench", along),))
        self._fts = Mailbox(node, "ft", wrench, MEASUREMENT, self._refuse, admit=admit["wrenches"])
        self._encoder, self._before = encoder, 0
        self._waiting_deflections: deque[tuple[int, float]] = deque(maxlen=WAITING)
        self._deflection = (0, math.nan)
        angle = MessageFields(JOINT_STATE, (("position", 0),), joint)
        self._deflections = encoder and Mailbox(node, "deflection", angle, MEASUREMENT, lambda: None)
        torque = MessageFields(JOINT_STATE, (("effort", 0),), joint)
        self._desired = Mailbox(
            node, "desired_torque", torque, COMMAND, self.desired.refuse, admit=admit["desired torques"]
        )
        self.subscriptions = [self._states.subscription, self._fts.subscription]

    def take(self) -> Iterator[tuple[int, Measurement]]:
        """Yield stamp (ns) and reading of each state that has a torque of its instant, or of a later one.

        Of its instant: to half a period. All that has arrived is taken first, so that a process that was held
        up has the newest at once.
        """
        self._waiting_fts += ((stamp, self._sign * torque) for stamp, (torque,), _ in self._fts.take())
        self._waiting_states += ((stamp, numbers) for stamp, numbers, _ in self._states.take())
        if self._deflections:
            self._waiting_deflections += ((t, angle) for t, (angle,), _ in self._deflections.take())
        while self._waiting_states and self._waiting_fts:
            stamp, (position, velocity, effort) = self._waiting_states[0]
            at, torque = self._waiting_fts[0]
            if at < stamp - 0.5 * self._period:
                self._waiting_fts.popleft()
                continue
            self._waiting_states.popleft()
            if is_measured(torque, self._most) and all(is_measured(x, HUGE) for x in (position, velocity)):
                ft_age = (stamp - at) / self._period
                link = self._link(stamp, torque, position, ft_age) if self._encoder else math.nan
                yield stamp, Measurement(torque, velocity, position, effort, ft_age, link)
            else:
                self._refuse()

    def _link(self, stamp: int, torque: float, position: float, ft_age: float) -> float:
        """Return the link's angle, rad, from the deflection of a state's instant or of the sample before."""
        assert self._encoder is not None
        waiting = self._waiting_deflections
        while waiting and waiting[0][0] <= stamp + 0.5 * self._period:
            self._deflection = waiting.popleft()
        at, deflection = self._deflection
        age, periods = (stamp - at) / self._period, (stamp - self._before) / self._period
        self._before = stamp
        if not -0.5 <= age <= OLD:
            deflection = math.nan
        return self._encoder.link(SpringReading(deflection, torque, position, age, ft_age, periods))

    def hear_desired(self, anchor: Anchor) -> None:
        """Queue all desired torques that have arrived."""
        now = anchor.now()
        for stamp, (torque,), received in self._desired.take(MOST):
            self.desired.add(stamp, torque, anchor.arrival(received, self._heard))
        self._heard = now

    def _refuse(self) -> None:
        self.unusable += 1
