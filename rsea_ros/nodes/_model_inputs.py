"""What the model node hears: commands, states and wrenches, taken together whenever a wrench wakes it.

An executor's turn takes longer than the filter; one for each wrench keeps the node cheap. What waits is
worked off by stamp, whatever topic it came on.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterator
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

Sample = tuple[int, int, float, float]
"""Stamp, kind, and position with motor torque, or the torque of a wrench."""


class Inputs:
    """Feeds the observer. Stamps are ns; the observer's seconds count from the first one."""

    def __init__(self, node: Node, observer: Observer, ft_timeout: float, axis: str, reliable: bool,
                 wake: Callable[[], None]) -> None:  # fmt: skip
        """wake: called when wrenches have come."""
        self._node, self._observer, self._axis = node, observer, axis
        self._timeout = round(ft_timeout * SECOND)
        self._epoch: int | None = None
        self._state_stamp = self._ft_stamp = self._told = 0
        self._periods: deque[float] = deque(maxlen=PERIODS)
        self.refused = self.unstamped = 0
        group, deep = Polled(), RECORD_RELIABLE if reliable else None
        self._commands, self._states = (
            node.create_subscription(JointState, topic, lambda _: None, deep or usual, callback_group=group)
            for topic, usual in (("torque_command", COMMAND), ("joint_states", MEASUREMENT))
        )
        self._first: list[WrenchStamped] = []
        self._wake = wake
        self._ft = node.create_subscription(WrenchStamped, "ft", self._on_ft, deep or MEASUREMENT)

    def take(self) -> Iterator[tuple[int, Estimate]]:
        """Work off what has come; yield the estimate at each wrench, at each state while ft is silent."""
        for message in _waiting(self._commands, JointState):
            self._command(message)
        states = list(_waiting(self._states, JointState))
        wrenches, self._first = [*self._first, *_waiting(self._ft, WrenchStamped)], []
        samples = [s for m in states if (s := self._state(m)) is not None]
        samples += [
            (stamp, _FT, torque, 0.0) for stamp, torque in (wrench_of(m, self._axis) for m in wrenches)
        ]
        for stamp, kind, a, b in sorted(samples):
            estimate = self._measured(stamp, kind, a, b)
            if estimate is not None and (kind == _FT or self.ft_silent):
                self._note_period(stamp)
                yield stamp, estimate

    def _on_ft(self, message: WrenchStamped) -> None:
        self._first = [message]
        self._wake()

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

    def _measured(self, stamp: int, kind: int, a: float, b: float) -> Estimate | None:
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
        return stamp, _STATE, position, torque

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
