"""What the model and the health node hear: stopped sensors, events in order, the noise that they expect."""

import json
import math
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
from rclpy.node import Node
from rclpy.qos import QoSProfile

from msg_adapters.topic_map import JOINT_STATE, WRENCH, sign_and_index
from rsea_ros.errors import ParameterError
from rsea_ros.model.extent import LARGEST
from rsea_ros.model.observer import Noise, Observer, TorqueEstimate, noise_of
from rsea_ros.model.observer.log import COMMAND, FT, STATE
from rsea_ros.model.rig import Rig
from rsea_ros.nodes import _qos
from rsea_ros.nodes._commands import HORIZON
from rsea_ros.nodes._cycle import SECOND
from rsea_ros.nodes._parameters import NodeParameter
from rsea_ros.nodes._tap import Mailbox, MessageFields
from rsea_ros.records.record import FloatArray, IntArray, is_measured

Keep = Callable[[str, str, int, bytes], None]
Event = tuple[int, int, float, float]
"""Stamp (ns), kind (of observer/log.py) and values: position and motor torque, or ft, or command."""


class JointTopics:
    """Commands, states and wrenches of a joint. refused: messages of no use. unstamped: commands."""

    def __init__(
        self, node: Node, axis: str, joint: str, commands: QoSProfile, measured: QoSProfile,
        keep: Keep | None = None,
    ) -> None:  # fmt: skip
        """joint: name that it must have; empty for any. keep: gets topic, type, arrival (ns), bytes."""
        self._sign, along = sign_and_index(axis)
        self.refused = self.unstamped = 0

        def mailbox(topic: str, kind: str, qos: QoSProfile, *fields: tuple[str, int]) -> Mailbox:
            def hear(at: int, raw: bytes) -> None:
                if keep is not None:
                    keep(box.subscription.topic_name, kind, at, raw)

            read = MessageFields(kind, fields, "" if topic == "ft" else joint)
            box = Mailbox(node, topic, read, qos, self.refuse, keep=hear)
            return box

        self._commands = mailbox("torque_command", JOINT_STATE, commands, ("effort", 0))
        self._states = mailbox("joint_states", JOINT_STATE, measured, ("position", 0), ("effort", 0))
        self.ft = mailbox("ft", WRENCH, measured, ("wrench", along))

    def events(self) -> list[Event]:
        """Return what has come since the last call, commands first."""
        events = [(t, COMMAND, u, math.nan) for t, (u,), _ in self._commands.take()]
        events += [(t, STATE, q, u) for t, (q, u), _ in self._states.take()]
        return events + [(t, FT, self._sign * y, math.nan) for t, (y,), _ in self.ft.take()]

    def instant(self, stamp: int, newest: int) -> int:
        """Return when a command counts: at its stamp, or at the newest measurement's if it is not near."""
        if stamp == 0 or (newest and abs(stamp - newest) > HORIZON):
            self.unstamped += 1
            return newest
        return stamp

    def refuse(self) -> None:
        """Count a message of no use."""
        self.refused += 1


SAMPLES, TIME, LONG = 10, 50_000_000, 500_000_000
"""Equal samples, and ns of them, that are no chance; ns of alike ones, which a gear that sticks makes too."""


class Frozen:
    """One topic's values. A sensor at rest may show the same counts; then something else must have moved.

    least: motion of the other sensor that proves a freeze; 0: none needed, this sensor's noise suffices.
    band: change of the first value that is its noise; 0: a stopped sensor repeats all of them exactly.
    doubted: whether it stands still beside such a motion. frozen: whether for too long to be chance.
    """

    def __init__(self, least: float = 0.0, band: float = 0.0) -> None:
        self._least, self._band, self._time = least, band, LONG if band else TIME
        self._last: Sequence[float] = ()
        self._since = self._count = 0
        self._low, self._high = math.inf, -math.inf
        self.doubted = self.frozen = False

    def take(self, stamp: int, values: Sequence[float]) -> bool:
        """Process a sample (stamp in ns); return whether the sensor has stopped."""
        stands = values == self._last
        if self._band:
            stands = bool(self._last) and abs(values[0] - self._last[0]) <= self._band
        if not stands or stamp < self._since:
            self._last, self._since, self._count = values, stamp, 0
            self._low, self._high, self.doubted, self.frozen = math.inf, -math.inf, False, False
        self._count += 1
        self.doubted = self.doubted or self._high - self._low >= self._least or self._least == 0.0
        if self._count >= SAMPLES and stamp - self._since >= self._time:
            self.frozen = self.doubted
        return self.frozen

    def beside(self, value: float) -> None:
        """Process a sample of another sensor."""
        self._low, self._high = min(self._low, value), max(self._high, value)


MOVED, LEAST, BAND = 12.0, 0.1, 6.0
"""Standard deviations of ft, and N m, by which it must move while joint_states stand still, to tell that they
have stopped: more than noise does in a second, less than what matters. Standard deviations of the position
within which it stands still under its noise."""


class StoppedSensors:
    """Watches joint_states and ft beside the commands."""

    def __init__(self, noise: Noise, stiffness: float = 0.0, *, ft_repeats: bool = False) -> None:
        """stiffness: of the spring, N m/rad.
        ft_repeats: whether ft may repeat a value at rest because its quantum exceeds its noise, as that of an
        encoder does.
        """
        least, band = max(MOVED * noise.ft, LEAST), BAND * noise.position
        self._by_ft = Frozen(least), Frozen(max(least, 2.0 * stiffness * band), band)
        self._by_command = Frozen(least), Frozen(least, band)
        self._ft, self._stiffness = Frozen(least if ft_repeats else 0.0), stiffness

    def take_state(self, stamp: int, position: float, effort: float) -> bool:
        """Process a state (ns, rad, N m); return whether it stands still while ft moves."""
        self._ft.beside(self._stiffness * position)
        for sensor in (*self._by_ft, *self._by_command):
            sensor.take(stamp, (position, effort))
        return any(sensor.doubted for sensor in self._by_ft)

    def take_ft(self, stamp: int, torque: float) -> bool:
        """Process a torque of the sensor (ns, N m); return whether ft has stopped."""
        for sensor in self._by_ft:
            sensor.beside(torque)
        return self._ft.take(stamp, (torque,))

    def take_command(self, torque: float) -> None:
        """Process a commanded torque, N m."""
        for sensor in self._by_command:
            sensor.beside(torque)

    @property
    def ft_frozen(self) -> bool:
        """Whether ft repeats a value where it should change."""
        return self._ft.frozen

    @property
    def frozen(self) -> list[str]:
        """Topics that repeat a value where it should change.

        Beside ft alone a position within its noise may be that of a gear that sticks while the load moves.
        """
        repeats, alike = self._by_ft
        stopped = repeats.frozen or (alike.frozen and self._by_command[1].frozen)
        topics = (("joint_states", stopped), ("ft", self._ft.frozen))
        return [topic for topic, is_frozen in topics if is_frozen]

    @property
    def unmoved(self) -> bool:
        """Whether joint_states repeat a value while commands move: they have stopped, or the drive is off."""
        return self._by_command[0].frozen


def stopped_sensors(rig: Rig, noise: Noise) -> StoppedSensors:
    """Return the watch of a rig's sensors."""
    ft = rig.sensors.get("ft")
    ft_repeats = ft is not None and ft.quantum > 2.0 * ft.noise
    return StoppedSensors(noise, rig["spring.stiffness"], ft_repeats=ft_repeats)


PERIODS = 64
PATIENCE = 6.0
"""s for which a topic that says nothing is waited for where all topics count in the order of their stamps:
the middleware repairs after 3 s what a busy machine lost."""


@dataclass(frozen=True)
class InputSettings:
    """How the topics are read: parameters of the node, by their names.

    ft_timeout: s. axis: of the wrench, with its sign. joint: name that the joint must have; empty for any.
    reliable: lose nothing, and process the topics in the order of their stamps, whichever is delivered first.
    """

    ft_timeout: float
    axis: str
    reliable: bool
    joint: str = ""


class ModelInputs(JointTopics):
    """Feeds the observer. Stamps are ns; the observer's seconds count from the first one."""

    def __init__(
        self, node: Node, observer: Observer, stopped: StoppedSensors, settings: InputSettings
    ) -> None:
        deep = _qos.RECORD_RELIABLE if settings.reliable else None
        commands, measured = deep or _qos.COMMAND, deep or _qos.MEASUREMENT
        super().__init__(node, settings.axis, settings.joint, commands, measured)
        self._observer, self.stopped = observer, stopped
        self._timeout = round(settings.ft_timeout * SECOND)
        self._epoch: int | None = None
        self._state_stamp = self._ft_stamp = self._estimate_stamp = 0
        self._periods: deque[float] = deque(maxlen=PERIODS)
        self._waits = PATIENCE if settings.reliable else 0.0
        self._waiting: list[tuple[float, Event]] = []
        self._newest = [(0, 0.0)] * 3

    def take(self) -> Iterator[tuple[int, TorqueEstimate]]:
        """Process messages; yield the estimate at each wrench, or at each state while ft is silent."""
        for stamp, kind, a, b in self._due():
            if kind == COMMAND:
                self._command(stamp, a)
                continue
            estimate = self._measure(stamp, a, b, kind)
            if estimate is not None and (kind == FT or self.ft_silent or self.stopped.ft_frozen):
                if 0 < stamp - self._estimate_stamp < SECOND:
                    self._periods.append((stamp - self._estimate_stamp) / SECOND)
                self._estimate_stamp = stamp
                yield stamp, estimate

    def _due(self) -> list[Event]:
        """Return the messages whose turn it is, in the order of the stamps, commands first.

        Its turn comes when every topic has told what it had before, is silent, or has been waited for.
        """
        came, now = self.events(), time.monotonic()
        self._waiting += [(now, message) for message in came]
        for stamp, kind, *_ in came:
            self._newest[kind] = stamp, now
        told = [stamp for stamp, heard in self._newest if stamp and now - heard < self._waits]
        late = [message[0] for arrival, message in self._waiting if now - arrival >= self._waits]
        turn = max(min(told, default=0), *late, 0)
        ready = (m for _, m in self._waiting if m[0] <= turn)
        due = sorted(ready, key=lambda m: (m[0], m[1] != COMMAND, m[1]))
        self._waiting = [(arrival, m) for arrival, m in self._waiting if m[0] > turn]
        return due

    def seconds(self, stamp: int) -> float:
        """Return a stamp in the observer's time, s."""
        if self._epoch is None:
            self._epoch = stamp
        return (stamp - self._epoch) / SECOND

    @property
    def ft_silent(self) -> bool:
        """Whether states have come for longer than the timeout since the last wrench."""
        return self._state_stamp - self._ft_stamp > self._timeout

    @property
    def ft_age(self) -> float:
        """Time from the last wrench, or from the start, to the last state, s."""
        return (self._state_stamp - self._ft_stamp) / SECOND

    @property
    def period(self) -> float:
        """Median time between estimates, s; nan before there are enough."""
        return median(self._periods) if len(self._periods) == PERIODS else math.nan

    def _measure(self, stamp: int, a: float, b: float, kind: int) -> TorqueEstimate | None:
        """Give a sample to the observer, unless its sensor has stopped. ft outvotes a state."""
        if kind == FT:
            if not is_measured(a, LARGEST):
                self.refuse()
                return None
            self._ft_stamp = stamp
            if self.stopped.take_ft(stamp, a):
                return None
            return self._observer.ft(self.seconds(stamp), a)
        if not self._ft_stamp or stamp < self._ft_stamp - SECOND:
            self._ft_stamp = stamp
        self._state_stamp = stamp
        doubted = self.stopped.take_state(stamp, a, b) and not self.ft_silent
        if doubted or "joint_states" in self.stopped.frozen:
            return None
        return self._observer.state(self.seconds(stamp), a, b)

    def _command(self, stamp: int, torque: float) -> None:
        stamp = self.instant(stamp, max(self._state_stamp, self._ft_stamp))
        if not math.isfinite(torque):
            self.refuse()
        elif stamp:
            self.stopped.take_command(torque)
            self._observer.command(self.seconds(stamp), torque)


LAG = SECOND // 10
"""ns that one topic may come later than another and still be put in its place."""
MOST = 10_000
"""Events that wait at most: commands without measurements would wait, and grow, for as long as these stop."""
Events = tuple[FloatArray, IntArray, FloatArray]
_TOPICS = ("joint_states", "ft", "torque_command")
"""By kind of the events on them."""


class HealthInputs(JointTopics):
    """Best-effort subscriptions; nothing waits for them. keep: as of JointTopics."""

    def __init__(self, node: Node, axis: str, joint: str, keep: Keep) -> None:
        super().__init__(node, axis, joint, _qos.RECORD, _qos.RECORD, keep)
        self.epoch: int | None = None
        self._newest = 0
        self._waiting: list[Event] = []
        self.counts = {"torque_command": 0, "joint_states": 0, "ft": 0}

    def take(self) -> Events:
        """Return the complete events: t (s since the first stamp), kind and values of a Look."""
        came = self.events()
        for _, kind, *_ in came:
            self.counts[_TOPICS[kind]] += 1
        measured = [event for event in came if event[1] != COMMAND]
        if measured:
            newest = max(event[0] for event in measured)
            if abs(newest - self._newest) > SECOND:
                self._waiting.clear()
            self._newest = newest
        for stamp, kind, torque, _ in came:
            if kind == COMMAND and not math.isfinite(torque):
                self.refuse()
            elif kind == COMMAND:
                measured.append((self.instant(stamp, self._newest), kind, torque, math.nan))
        self._waiting = sorted(self._waiting + measured)[-MOST:]
        return self._ready()

    def _ready(self) -> Events:
        """Return the events that are old enough, and keep the others."""
        limit = self._newest - LAG
        ready = [row for row in self._waiting if row[0] <= limit]
        self._waiting = self._waiting[len(ready) :]
        if ready and self.epoch is None:
            self.epoch = ready[0][0]
        stamps = np.array([row[0] - (self.epoch or 0) for row in ready], dtype=np.int64)
        values = np.array([row[2:] for row in ready], dtype=np.float64).reshape(-1, 2)
        return stamps / SECOND, np.array([row[1] for row in ready], dtype=np.int64), values

    def stamp(self, t: float) -> int:
        """Return the stamp of an instant, ns since 1970."""
        return (self.epoch or 0) + round(t * SECOND)


IDENTIFICATION = NodeParameter(
    "identification", "", "identification.json whose measured noise counts; empty: that of the rig"
)
"""Of a node that knows the noise of its joint."""
_EXPECTED = "expected an identification.json of rsea identify"


def noise_from(rig: Rig, path: str) -> Noise:
    """Return the noise of a rig, measured where an identification.json is named.

    Raises ParameterError for a file of another kind.
    """
    if not path:
        return noise_of(rig)
    try:
        document = json.loads(Path(path).read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        why = error.strerror if isinstance(error, OSError) else "no JSON"
        raise ParameterError(f"parameter identification = {path!r}: {why}, {_EXPECTED}") from None
    if not isinstance(document, dict):
        raise ParameterError(f"parameter identification = {path!r}, {_EXPECTED}")
    return noise_of(rig, _numbers(document, "noise_rms", path), _numbers(document, "residual_rms", path))


def _numbers(document: Mapping[str, Any], name: str, path: str) -> dict[str, float]:
    values = document.get(name)
    if not isinstance(values, dict):
        raise ParameterError(f"{path}: {name} = {values!r}, expected numbers by channel")
    numbers = {channel: v for channel, v in values.items() if isinstance(v, (int, float))}
    for channel, value in numbers.items():
        if not 0 <= value <= LARGEST:
            raise ParameterError(f"{path}: {name}.{channel} = {str(value)[:40]}, expected 0 to {LARGEST:g}")
    return {channel: float(value) for channel, value in numbers.items()}
