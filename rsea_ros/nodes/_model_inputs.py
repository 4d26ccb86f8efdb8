"""What the model node hears: commands, states and wrenches, taken together, worked off by stamp."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator
from statistics import median
from typing import Any

from rclpy.node import Node

from msg_adapters.ros import JointState, WrenchStamped, effort_of, joint_state_of, wrench_of
from rsea_ros.errors import ParameterError
from rsea_ros.model.observer import COMMAND as COMMANDED
from rsea_ros.model.observer import FT, STATE, Estimate, Observer
from rsea_ros.nodes._bench import Polled
from rsea_ros.nodes._commands import HORIZON
from rsea_ros.nodes._cycle import SECOND
from rsea_ros.nodes._qos import COMMAND, MEASUREMENT, RECORD_RELIABLE

PERIODS = 64

Stamped = tuple[int, int, float, float]
"""A sample of the observer, with its stamp in ns."""


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
        commands = [c for m in _waiting(self._commands, JointState) if (c := self._command(m)) is not None]
        samples = [s for m in _waiting(self._states, JointState) if (s := self._state(m)) is not None]
        wrenches = (wrench_of(m, self._axis) for m in _waiting(self.ft, WrenchStamped))
        samples += [(t, FT, torque, 0.0) for t, torque in wrenches]
        samples.sort()
        together = [*commands, *samples]
        estimates = self._observer.take((self.seconds(t), kind, a, b) for t, kind, a, b in together)
        for (stamp, kind, _, _), estimate in zip(samples, estimates[len(commands) :], strict=True):
            self._heard(stamp, kind)
            if estimate is not None and (kind == FT or self.ft_silent):
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

    def _heard(self, stamp: int, kind: int) -> None:
        if kind == FT:
            self._ft_stamp = stamp
            return
        if not self._ft_stamp or stamp < self._ft_stamp - SECOND:
            self._ft_stamp = stamp
        self._state_stamp = stamp

    def _note_period(self, stamp: int) -> None:
        if 0 < stamp - self._told < SECOND:
            self._periods.append((stamp - self._told) / SECOND)
        self._told = stamp

    def _state(self, message: JointState) -> Stamped | None:
        try:
            stamp, position, _velocity, torque = joint_state_of(message)
        except ParameterError as error:
            self._refuse("joint_states", error)
            return None
        return stamp, STATE, position, torque

    def _command(self, message: JointState) -> Stamped | None:
        try:
            stamp, torque = effort_of(message)
        except ParameterError as error:
            self._refuse("torque_command", error)
            return None
        newest = max(self._state_stamp, self._ft_stamp)
        if stamp == 0 or (newest and abs(stamp - newest) > HORIZON):
            self.unstamped += 1
            stamp = newest
        if not math.isfinite(torque):
            self.refused += 1
        return (stamp, COMMANDED, torque, 0.0) if stamp and math.isfinite(torque) else None

    def _refuse(self, topic: str, error: ParameterError) -> None:
        self.refused += 1
        self._node.get_logger().error(f"{topic}: {error}", throttle_duration_sec=1.0)


def _waiting(subscription: Any, kind: Any) -> Iterator[Any]:
    """Yield the messages that wait in a subscription."""
    handle = subscription.handle
    with handle:
        while (message := handle.take_message(kind, False)) is not None:
            yield message[0]
