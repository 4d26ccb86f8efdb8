"""What the model node hears: commands, states and wrenches, taken together, worked off by stamp."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator
from operator import itemgetter
from statistics import median
from typing import Any

from rclpy.node import Node

from msg_adapters.ros import JointState, WrenchStamped, effort_of, joint_state_of, wrench_of
from rsea_ros.errors import ParameterError
from rsea_ros.model.observer import Estimate, Observer
from rsea_ros.nodes._bench import Polled
from rsea_ros.nodes._commands import HORIZON
from rsea_ros.nodes._cycle import SECOND
from rsea_ros.nodes._qos import COMMAND, MEASUREMENT, RECORD_RELIABLE

PERIODS = 64

_STATE, _FT = range(2)

Sample = tuple[int, float, float, int]
"""Stamp (ns), position and motor torque, or the torque of a wrench and nan, and which of both it is."""


class Inputs:
    """Feeds the observer. Stamps are ns; the observer's seconds count from the first one."""

    def __init__(self, node: Node, observer: Observer, ft_timeout: float, axis: str, reliable: bool) -> None:
        self._node, self._observer, self._axis = node, observer, axis
        self._timeout = round(ft_timeout * SECOND)
        self._epoch: int | None = None
        self._state_stamp = self._ft_stamp = self._told = 0
        self._periods: deque[float] = deque(maxlen=PERIODS)
        self.refused = self.unstamped = 0
        group, deep = Polled(), RECORD_RELIABLE if reliable else None
        self._commands, self._states, self.ft = (
            node.create_subscription(kind, topic, lambda _: None, deep or usual, callback_group=group)
            for kind, topic, usual in (
                (JointState, "torque_command", COMMAND),
                (JointState, "joint_states", MEASUREMENT),
                (WrenchStamped, "ft", MEASUREMENT),
            )
        )

    def take(self) -> Iterator[tuple[int, Estimate]]:
        """Work off what has come; yield the estimate at each wrench, at each state while ft is silent."""
        for message in _waiting(self._commands, JointState):
            self._command(message)
        samples = [s for m in _waiting(self._states, JointState) if (s := self._state(m)) is not None]
        samples += [(*wrench_of(m, self._axis), math.nan, _FT) for m in _waiting(self.ft, WrenchStamped)]
        samples.sort(key=itemgetter(0, 3))
        for stamp, a, b, kind in samples:
            estimate = self._measured(stamp, a, b, kind)
            if estimate is not None and (kind == _FT or self.ft_silent):
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

    def _measured(self, stamp: int, a: float, b: float, kind: int) -> Estimate | None:
        if kind == _FT:
            self._ft_stamp = stamp
            return self._observer.ft(self.seconds(stamp), a)
        if not self._ft_stamp or stamp < self._ft_stamp - SECOND:
            self._ft_stamp = stamp
        self._state_stamp = stamp
        return self._observer.state(self.seconds(stamp), a, b)

    def _note_period(self, stamp: int) -> None:
        if 0 < stamp - self._told < SECOND:
            self._periods.append((stamp - self._told) / SECOND)
        self._told = stamp

    def _state(self, message: JointState) -> Sample | None:
        try:
            stamp, position, _velocity, torque = joint_state_of(message)
        except ParameterError as error:
            self._refuse("joint_states", error)
            return None
        return stamp, position, torque, _STATE

    def _command(self, message: JointState) -> None:
        try:
            stamp, torque = effort_of(message)
        except ParameterError as error:
            self._refuse("torque_command", error)
            return
        newest = max(self._state_stamp, self._ft_stamp)
        if stamp == 0 or (newest and abs(stamp - newest) > HORIZON):
            self.unstamped += 1
            stamp = newest
        if not math.isfinite(torque):
            self.refused += 1
        elif stamp:
            self._observer.command(self.seconds(stamp), torque)

    def _refuse(self, topic: str, error: ParameterError) -> None:
        self.refused += 1
        self._node.get_logger().error(f"{topic}: {error}", throttle_duration_sec=1.0)


def _waiting(subscription: Any, kind: Any) -> Iterator[Any]:
    """Yield the messages that wait in a subscription."""
    handle = subscription.handle
    with handle:
        while (message := handle.take_message(kind, False)) is not None:
            yield message[0]
