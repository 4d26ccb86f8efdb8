"""The commands of the live view: the limits of the bench, who else commands, the cycle that publishes."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from functools import partial
from typing import Any

from rclpy.node import Node
from rclpy.parameter_client import AsyncParameterClient
from rclpy.serialization import serialize_message

from msg_adapters.raw import RawWriter
from msg_adapters.ros import JointState, torque_command_message
from msg_adapters.topic_map import JOINT_STATE
from rsea_ros.nodes._cycle import SECOND, Cycle
from rsea_ros.nodes._qos import COMMAND, await_arrival
from rsea_ros.nodes._watch_source import WatchSource
from rsea_ros.watch.command import Bounds, Commander

LEAD = SECOND // 50
"""ns by which a command is published before it takes effect: longer than this process is held up."""
MARGIN = SECOND // 200
"""A command that has less than this left until it takes effect is left out, as by excite."""
LIMITS = ("torque_limit", "slew_limit", "soft_start")
"""Parameters of a driver; a plant has none. A negative one is derived: the driver itself cuts commands."""
LOOK = 0.5
"""s between looks at who is there."""
ANSWER = 2.0
"""s after which limits are requested again: the first answer of a bench just found may be lost."""


class WatchCommand:
    """Commands of a page on the grid of the measurements. why_not: why none may be held now, or nothing."""

    def __init__(self, node: Node, source: WatchSource, values: Mapping[str, Any]) -> None:
        self._node, self._source = node, source
        self._rate: float = values["rate"]
        self._most = Bounds(values["limit"], math.inf, values["growth"])
        self.commander = Commander()
        self.why_not = "nothing is known of the bench yet"
        self._publisher = node.create_publisher(JointState, "torque_command", COMMAND)
        template = serialize_message(torque_command_message(0, 0.0, values["joint"]))
        self._writer = RawWriter(template, JOINT_STATE, "effort")
        self._bench = ""
        self._client: AsyncParameterClient | None = None
        self._asked = -math.inf
        self._cycle: Cycle | None = None
        self._due = 0.0

    def look(self) -> None:
        """Check the publishers, and start or end the cycle. Raises its error."""
        if time.monotonic() >= self._due:
            self._due = time.monotonic() + LOOK
            self._see_to_the_limits()
            self.why_not = self._reason()
        if self._cycle is not None:
            self._cycle.is_running()
            if not self.commander.active:
                self._cycle.stop()
                self._cycle = None
        elif self.commander.active and self._source.newest:
            self._cycle = Cycle(self._rate, self._step, catch_up=False)
            self._cycle.start(self._first() - LEAD)

    def close(self) -> None:
        """End with zeros that have arrived, whichever page holds the command."""
        if self.commander.holder is not None:
            self.commander.release(self.commander.holder)
        deadline = time.monotonic() + 1.0
        while self._cycle is not None and self.commander.active and time.monotonic() < deadline:
            time.sleep(0.01)
        if self._cycle is not None:
            self._cycle.stop()
        await_arrival(self._publisher)

    def _step(self, stamp: int) -> None:
        assert self._cycle is not None
        anchor = self._cycle.anchor
        torque = self.commander.torque((stamp - anchor.offset) / SECOND)
        if torque is not None and stamp + LEAD - anchor.now() > MARGIN:
            self._publisher.publish(self._writer.write(stamp + LEAD, [torque]))

    def _first(self) -> int:
        """Return when the first command takes effect, ns: a whole number of periods after a measurement."""
        earliest = time.time_ns() + 2 * LEAD
        periods = math.ceil((earliest - self._source.newest) * self._rate / SECOND)
        return self._source.newest + round(periods * SECOND / self._rate)

    def _see_to_the_limits(self) -> None:
        """Request the limits from the publisher of joint_states until it has said them."""
        bench = ", ".join(sorted(self._publishers("joint_states")))
        if bench != self._bench:
            self._bench, self._client, self._asked, self.commander.bounds = bench, None, -math.inf, None
        if not bench or "," in bench or self.commander.bounds is not None:
            return
        self._client = self._client or AsyncParameterClient(self._node, bench)
        if time.monotonic() > self._asked + ANSWER and self._client.services_are_ready():
            self._asked = time.monotonic()
            self._client.get_parameters(list(LIMITS)).add_done_callback(partial(self._on_limits, bench))

    def _on_limits(self, bench: str, future: Any) -> None:
        if bench != self._bench:  # that bench has left
            return
        told = future.result().values
        values = [v.double_value if v.type and v.double_value >= 0.0 else math.inf for v in told]
        torque, slew, growth = [*values, math.inf, math.inf, math.inf][:3]
        most = self._most
        self.commander.bounds = Bounds(min(torque, most.torque), slew, min(growth, most.growth))

    def _reason(self) -> str:
        others = self._publishers("torque_command") - {self._node.get_fully_qualified_name()}
        if others:
            return f"{', '.join(sorted(others))} commands already"
        if not self._bench:
            return "nobody publishes joint_states"
        if "," in self._bench:
            return f"{self._bench} publish joint_states, expected one"
        return f"{self._bench} has not said its limits yet" if self.commander.bounds is None else ""

    def _publishers(self, topic: str) -> set[str]:
        name = self._node.resolve_topic_name(topic)
        infos = self._node.get_publishers_info_by_topic(name)
        return {f"{i.node_namespace.rstrip('/')}/{i.node_name}" for i in infos}
