"""The controller's limits, and what it measures: the actuator's topics and the link's motion."""

import math
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from rclpy.node import Node

from msg_adapters.topic_map import JOINT_STATE, WRENCH, sign_and_index
from rsea_ros.control.compensation import compensation
from rsea_ros.control.controller import ControllerSettings, Measurement, TorqueController, TorqueLimits
from rsea_ros.control.grid import Lateness, Tolerance
from rsea_ros.control.law import Gains, law_of
from rsea_ros.control.link import LinkMotion, LinkShare, SpringEncoder, SpringReading, link_share, spread
from rsea_ros.control.synthesis import ControllerDesign, DesignLimits, check, design
from rsea_ros.control.uncertainty import LIGHTEST, lightest, load_range, load_uncertainty
from rsea_ros.errors import ParameterError
from rsea_ros.hardware.device import State
from rsea_ros.model.rig import Rig
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.rig_limits import SLEW, derive, derive_rest
from rsea_ros.nodes._commands import CommandQueue, Obeyed
from rsea_ros.nodes._cycle import REALTIME, Anchor
from rsea_ros.nodes._devices import witnesses_of
from rsea_ros.nodes._parameters import AXIS, DERIVED, JOINT, NodeParameter, live, stated_limits
from rsea_ros.nodes._qos import COMMAND, MEASUREMENT
from rsea_ros.nodes._tap import Mailbox, MessageFields
from rsea_ros.records.record import HUGE, NONSENSE, is_measured

Values = Mapping[str, Any]

GAINS = ("k_p", "k_d", "k_i", "q_frequency", "k_w")
LIMITS = ("torque_limit", "slew_limit", "error_limit", "error_time", "ft_limit")
TABLE = live((
    NodeParameter("rig", "paper_high_impedance", "the bench: a name of config/rigs, or a model.yaml"),
    NodeParameter("free", "", f"rig whose ends are the lightest load; empty: rig's, {LIGHTEST} if clamped"),
    NodeParameter("uncertainty", "", "YAML of what it must tolerate (docs/control.md); empty: from the rig"),
    NodeParameter("rate", 280.0, "measurements a second", "Hz", 50.0, 1000.0),
    AXIS,
    NodeParameter("k_p", -1.0, "gain on the torque error; -1: all five gains by synthesis", "", -1.0, 1e4),
    NodeParameter("k_d", -1.0, "gain on the rate of the torque error; -1: see k_p", "s", -1.0, 1e3),
    NodeParameter("k_i", -1.0, "gain on the slow torque error; -1: see k_p", "", -1.0, 1e3),
    NodeParameter(
        "q_frequency", -1.0, "of the disturbance observer's filter; -1: see k_p", "Hz", -1.0, 500.0
    ),
    NodeParameter("k_w", -1.0, "damping of the gear about the model; -1: see k_p", "N m s/rad", -1.0, 1e4),
    NodeParameter("sensitivity", 2.0, "largest of the rig itself, with every load", "", 1.1, 5.0),
    NodeParameter("robust", 3.0, "largest sensitivity of the whole set of benches", "", 1.1, 20.0),
    NodeParameter("impedance", 2.0, "largest output impedance over that of the bare spring", "", 1.0, 20.0),
    NodeParameter("compensate", True, "whether friction, ripple and backlash of the rig are compensated"),
    NodeParameter("learn", True, "whether load and drive are learned; not inside an outer impedance loop"),
    NodeParameter(
        "link", True, "whether the link's motion is fed forward where the rig has a sensor deflection"
    ),
    NodeParameter("preview", False, "desired torques are stamped two samples ahead or more: no prediction"),
    NodeParameter(
        "prediction", ControllerSettings.corner, "what a desired torque does faster is not predicted", "Hz",
        1.0, 500.0,
    ),
    NodeParameter(
        "torque_limit", DERIVED, "largest torque that is commanded; -1: as the driver derives it", "N m",
        DERIVED, 1000.0,
    ),
    NodeParameter("slew_limit", SLEW, "largest change of torque in a second", "N m/s", 1.0, 1e6),
    NodeParameter("ramp", 0.25, "in which the limit grows after a start", "s", 0.0, 10.0),
    NodeParameter("stale", 0.05, "time without a measurement that ends the torque", "s", 0.005, 1.0),
    NodeParameter("release", 0.02, "from there to zero torque", "s", 0.0, 1.0),
    NodeParameter(
        "error_limit", DERIVED,
        "of the torque against the desired one, for error_time; 0: none; -1: derived", "N m", DERIVED, 1e3,
    ),
    NodeParameter("error_time", 0.5, "for which the error may be larger", "s", 0.0, 60.0),
    NodeParameter(
        "ft_limit", DERIVED, "largest torque that ft may measure; 0: none; -1: derived", "N m", DERIVED, 1e3
    ),
    NodeParameter("late_share", 0.5, "of the commands of late_time that may be late", "", 0.01, 1.0),
    NodeParameter("late_time", 1.0, "over which late commands are counted", "s", 0.05, 60.0),
    JOINT,
    *REALTIME,
), {*GAINS, "torque", "slew", "error", "error_time", "ft"})  # fmt: skip


def with_limits(values: Values) -> dict[str, Any]:
    """Return the values with the limits that the rig derives, as the driver's. Raises ParameterError."""
    stated = stated_limits(values, ("torque", "ft", "error"))
    limits, _ = derive(stated, load_rig(values["rig"]))
    limits |= derive_rest(stated, limits["torque"], limits["torque"], limits["velocity"])[0]
    return {**values, **{f"{name}_limit": limits[name] for name in ("torque", "ft", "error")}}


def design_of(values: Values) -> ControllerDesign:
    """Return the requested design. Raises ParameterError where it is unstable with a load."""
    rig = load_rig(values["rig"])
    loads = load_range(rig, lightest(rig, values["free"]))
    stated = [values[name] for name in GAINS]
    u = load_uncertainty(values["uncertainty"], rig, values["rate"]) if values["uncertainty"] else None
    if all(value >= 0.0 for value in stated):
        return check(rig, loads, values["rate"], Gains(*stated), u)
    if any(value >= 0.0 for value in stated):
        given = ", ".join(f"{value:g}" for value in stated)
        raise ParameterError(f"parameters {', '.join(GAINS)} = {given}, expected all five, or -1 for all")
    names = ("sensitivity", "robust", "impedance")
    return design(rig, loads, values["rate"], DesignLimits(*(values[name] for name in names)), u)


def torque_limits(values: Values) -> TorqueLimits:
    """Return the limits of what is commanded."""
    return TorqueLimits(values["torque_limit"], values["slew_limit"], values["ramp"])


def controller_of(values: Values, designed: ControllerDesign, link: LinkShare) -> TorqueController:
    """Return the controller for the parameters. link: what of the link's motion it feeds forward."""
    limits, compensate = torque_limits(values), None if values["compensate"] else ()
    settings = ControllerSettings(compensate, values["preview"], values["prediction"], values["learn"])
    rig, rate = load_rig(values["rig"]), values["rate"]
    return TorqueController(rig, rate, designed.gains, limits=limits, link=link, settings=settings)


def summary(designed: ControllerDesign) -> list[str]:
    """Return gains, margins and what they tolerate as lines for the log."""
    g, tolerated = designed.gains, designed.uncertainty
    unstated = "" if tolerated.mode else "; no mode of the F/T sensor's mount: `uncertainty` states one"
    head = (
        f"k_p {g.k_p:.3f}, k_d {1e3 * g.k_d:.2f} ms, k_i {g.k_i:.2f}, Q {g.q_frequency:.1f} Hz, "
        f"k_w {g.k_w:.1f} N·m·s/rad at {designed.rate:g} Hz; "
        f"largest sensitivity of the set {designed.sensitivity:.2f}"
    )
    return [head, f"tolerated: {tolerated}{unstated}"] + [
        f"{name}: crossover {m.crossover:.1f} Hz, phase margin {m.phase:.1f} deg, "
        f"gain margin {m.gain:.1f} dB, delay margin {m.delay:.2f} samples"
        for name, m in designed.margins.items()
    ]


OBEYED, SEEN = 0.05, 3.0
"""s after which a motor makes the torque that is commanded, N m, of which so much is surely seen."""
ON_TOPICS = {"axis": "torque.z", "position_zero": "configure", "encoder_id": -1}
"""Of a driver, as its topics are read: without their sign, and a rest tells what the angle counts from."""


class ControllerLimits:
    """Follows commands and torques sample by sample. lateness: of the commands."""

    def __init__(self, values: Mapping[str, Any]) -> None:
        """values: parameters of the controller node."""
        self.limit(values)
        self.lateness = Lateness(values["rate"], Tolerance(values["late_share"], values["late_time"]))
        self._off = self._idle = 0
        self._patience = max(1, round(OBEYED * values["rate"]))
        self._witnesses = witnesses_of({**values, **ON_TOPICS})

    def limit(self, values: Mapping[str, Any]) -> None:
        """Keep other limits from the next sample on."""
        self._error_limit, self._ft_limit = values["error_limit"], values["ft_limit"]
        self._longest = max(1, round(values["error_time"] * values["rate"]))

    def clear(self) -> None:
        """Restart."""
        self.lateness.clear()
        self._off = self._idle = 0

    def idle(self, commanded: float, made: float) -> bool:
        """Return whether the motor makes no torque although one is commanded (N m): its driver has a fault.

        The torque commanded meanwhile must not act when the driver's fault is cleared.
        """
        self._idle = self._idle + 1 if abs(commanded) > SEEN and abs(made) < 0.2 * SEEN else 0
        if self._idle < self._patience:
            return False
        self._idle = 0
        return True

    def falsified(self, stamp: int, r: Measurement, commanded: float) -> str:
        """Return the fault of an ft that spring and motor contradict, in words, empty without one.

        Its feedback would take the motor to a multiple of the desired torque, whatever the driver does
        (decision 314). stamp: of the reading, ns. commanded: N m.
        """
        wrench = (0.0, 0.0, 0.0, 0.0, 0.0, r.ft)
        state = State(stamp, r.position, r.velocity, r.motor_torque, stamp, wrench)
        return str((self._witnesses and self._witnesses.take(state, commanded)) or "")

    @property
    def contradiction(self) -> str:
        """What contradicts ft for half a second, less gravely than for a fault, in words."""
        return self._witnesses.words if self._witnesses else ""

    def fault(self, ft: float, desired: float) -> str:
        """Return the fault that must end the torque, in words; empty without one.

        ft, desired: N m, of this sample.
        A sample with a small error cancels one with a large error, so a sine does not hide the error.
        """
        error = abs(ft - desired)
        self._off = max(0, self._off + (1 if error > self._error_limit else -1))
        if abs(ft) > self._ft_limit:
            return f"ft of {ft:.4g} N·m, expected at most ft_limit = {self._ft_limit:g} N·m"
        if self._off > self._longest:
            return (
                f"ft is {error:.4g} N·m off the desired torque, expected at most"
                f" error_limit = {self._error_limit:g} N·m for error_time"
            )
        if self.lateness.persists:
            tolerance = self.lateness.tolerance
            return (
                f"{self.lateness.count} commands more than {tolerance.late:g} sample late in the last"
                f" {tolerance.time:g} s, expected less than {100.0 * tolerance.share:.0f} % of them"
            )
        return ""


LOUD = 0.02
"""Of torque_limit: RMS of the torque that the noise of both encoders may make."""
HEARD = 2000
"""Samples of noise that show it."""


class LinkFeedforward(NamedTuple):
    """share: what is fed forward. encoder: None where nothing is, and `reason` says why."""

    share: LinkShare
    encoder: SpringEncoder | None
    reason: str

    def __str__(self) -> str:
        """Return it as a line for the log."""
        if self.encoder is None:
            return f"motion of the link is not fed forward: {self.reason}"
        s = self.share
        return (
            f"motion of the link is fed forward once deflection agrees with ft: {s.inertia:g} of the inertia,"
            f" {s.damping:g} of the damping, below {s.corner:g} Hz"
        )

    def values(self) -> dict[str, object]:
        """Return it as diagnostics show it."""
        encoder = self.encoder
        if encoder is None:
            return {"link": f"not used: {self.reason}"}
        waiting = f"not used: {encoder.trouble or 'deflection and ft have not been compared in motion yet'}"
        return {
            "link": "used" if encoder.used else waiting,
            "link_losses": encoder.losses,
            "missing_deflections": encoder.missing,
        }


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
