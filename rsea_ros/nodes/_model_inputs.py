"""Inputs of the model node: commands, states and wrenches, processed in the order of their stamps."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from operator import itemgetter
from statistics import median

from rclpy.node import Node

from msg_adapters.topic_map import JOINT_STATE, WRENCH, sign_and_index
from rsea_ros.model.observer import Observer, TorqueEstimate
from rsea_ros.nodes._commands import HORIZON
from rsea_ros.nodes._cycle import SECOND
from rsea_ros.nodes._mailbox import Mailbox, MessageFields
from rsea_ros.nodes._qos import COMMAND, MEASUREMENT, RECORD_RELIABLE
from rsea_ros.nodes._stopped_sensors import StoppedSensors

PERIODS = 64
_STATE, _FT = range(2)


@dataclass(frozen=True)
class InputSettings:
    """How the topics are read: parameters of the node, by their names.

    ft_timeout: s. axis: of the wrench, with its sign. joint: name that the joint must have; empty for any.
    """

    ft_timeout: float
    axis: str
    reliable: bool
    joint: str = ""


class ModelInputs:
    """Feeds the observer. Stamps are ns; the observer's seconds count from the first one."""

    def __init__(
        self, node: Node, observer: Observer, stopped: StoppedSensors, settings: InputSettings
    ) -> None:
        self._observer, self.stopped = observer, stopped
        self._sign, along = sign_and_index(settings.axis)
        self._timeout = round(settings.ft_timeout * SECOND)
        self._epoch: int | None = None
        self._state_stamp = self._ft_stamp = self._estimate_stamp = 0
        self._periods: deque[float] = deque(maxlen=PERIODS)
        self.refused = self.unstamped = 0
        deep = RECORD_RELIABLE if settings.reliable else None
        self._commands, self._states, self.ft = (
            Mailbox(
                node,
                topic,
                MessageFields(kind, tuple(fields), "" if topic == "ft" else settings.joint),
                deep or usual,
                self._refuse,
            )
            for kind, topic, usual, *fields in (
                (JOINT_STATE, "torque_command", COMMAND, ("effort", 0)),
                (JOINT_STATE, "joint_states", MEASUREMENT, ("position", 0), ("effort", 0)),
                (WRENCH, "ft", MEASUREMENT, ("wrench", along)),
            )
        )

    def take(self) -> Iterator[tuple[int, TorqueEstimate]]:
        """Process new messages; yield the estimate at each wrench, or at each state while ft is silent."""
        for stamp, (torque,), _ in self._commands.take():
            self._command(stamp, torque)
        samples = [(t, q, u, _STATE) for t, (q, u), _ in self._states.take()]
        samples += [(t, self._sign * y, math.nan, _FT) for t, (y,), _ in self.ft.take()]
        samples.sort(key=itemgetter(0, 3))
        for stamp, a, b, kind in samples:
            estimate = self._measure(stamp, a, b, kind)
            if estimate is not None and (kind == _FT or self.ft_silent or self.stopped.ft_frozen):
                self._note_period(stamp)
                yield stamp, estimate

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
        """Give a sample to the observer, unless its sensor has stopped."""
        if kind == _FT:
            self._ft_stamp = stamp
            if self.stopped.take_ft(stamp, a):
                return None
            return self._observer.ft(self.seconds(stamp), a)
        if not self._ft_stamp or stamp < self._ft_stamp - SECOND:
            self._ft_stamp = stamp
        self._state_stamp = stamp
        if self.stopped.take_state(stamp, a, b):
            return None
        return self._observer.state(self.seconds(stamp), a, b)

    def _note_period(self, stamp: int) -> None:
        if 0 < stamp - self._estimate_stamp < SECOND:
            self._periods.append((stamp - self._estimate_stamp) / SECOND)
        self._estimate_stamp = stamp

    def _command(self, stamp: int, torque: float) -> None:
        newest = max(self._state_stamp, self._ft_stamp)
        if stamp == 0 or (newest and abs(stamp - newest) > HORIZON):
            self.unstamped += 1
            stamp = newest
        if not math.isfinite(torque):
            self._refuse()
        elif stamp:
            self.stopped.take_command(torque)
            self._observer.command(self.seconds(stamp), torque)

    def _refuse(self) -> None:
        self.refused += 1
