"""replay: publishes a bag again, with the stamps that its messages have, at any pace, and /clock."""

from __future__ import annotations

import time
from collections.abc import Iterable
from typing import Any

from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile, ReliabilityPolicy

from msg_adapters import iterate
from msg_adapters.ros import Clock, message_type, time_of
from rsea_ros.errors import BagError, ParameterError
from rsea_ros.nodes._cycle import SECOND, Worker, wait_until
from rsea_ros.nodes._health import OK, STEADY, Health, NodeHealth
from rsea_ros.nodes._parameters import NodeParameter
from rsea_ros.nodes._qos import DISCOVERY_TIME, LATCHED, RECORD_RELIABLE
from rsea_ros.nodes._run import Component

TABLE = (
    NodeParameter("bag", "", "bag to play, a directory or a file"),
    NodeParameter("rate", 1.0, "pace: 2 is twice as fast as recorded", "", 0.01, 1000.0),
    NodeParameter("start", 0.0, "begin so far into the bag", "s", 0.0, 1e6),
    NodeParameter(
        "subscribers", 1, "subscriptions of each of the three topics to wait for; 0: begin at once",
        "", 0, 100,
    ),
    NodeParameter("clock", True, "whether to publish /clock"),
)
WAIT_FOR = ("torque_command", "joint_states", "ft")
NEVER = {"/diagnostics", "/clock", "/rosout", "/parameter_events"}
CLOCK_PERIOD = SECOND // 100
CLOCK = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
"""As of rosbag2 and of use_sim_time: a reliable subscription waits up to 3 s for a time that was lost."""
HEARTBEAT = Duration(seconds=4)
"""Longer than the middleware takes to learn that a reliable subscriber has everything."""


class ReplayNode(Worker):
    """A thread that publishes serialised messages when they are due. It ends when all have arrived."""

    def __init__(self, node: Node, values: dict[str, Any]) -> None:
        if not values["bag"]:
            raise ParameterError("parameter bag is empty, expected the path of a bag")
        super().__init__()
        self._node, self._pace = node, values["rate"]
        rows = list(iterate(values["bag"]))
        begin = rows[0][2] + round(values["start"] * SECOND) if rows else 0
        self._rows = [row for row in rows if row[2] >= begin and row[0] not in NEVER]
        if not self._rows:
            raise BagError(f"{values['bag']}: no message after {values['start']:g} s, expected some")
        self._publishers = self._advertise({(topic, kind) for topic, kind, _, _ in self._rows})
        self._clock = node.create_publisher(Clock, "/clock", CLOCK) if values["clock"] else None
        self._wanted = values["subscribers"]
        self._played = 0
        self._health = Health(node, self._report)
        node.create_timer(1.0, self._tell, clock=STEADY)
        self.start()

    def _advertise(self, topics: Iterable[tuple[str, str]]) -> dict[str, Publisher[Any]]:
        """Return a publisher for each topic whose type is installed."""
        publishers = {}
        for topic, kind in topics:
            qos = LATCHED if topic.endswith(("/pure_torque", "/pure_torque_stamped")) else RECORD_RELIABLE
            try:
                publishers[topic] = self._node.create_publisher(message_type(kind), topic, qos)
            except ParameterError as error:
                self._node.get_logger().warning(f"{topic} is left out: {error}")
        return publishers

    def run(self) -> None:
        """Publish them."""
        heard = [each for topic, each in self._publishers.items() if topic.rpartition("/")[2] in WAIT_FOR]
        while any(publisher.get_subscription_count() < self._wanted for publisher in heard):
            if self.stopping.wait(0.05):
                return
        self.stopping.wait(DISCOVERY_TIME / SECOND)
        begin, first, ticked = time.monotonic_ns(), self._rows[0][2], 0
        for topic, _, logged, raw in self._rows:
            if self.stopping.is_set():
                return
            due = begin + round((logged - first) / self._pace)
            while (now := time.monotonic_ns()) < due and not self.stopping.is_set():
                ticked = self._tick(first + round((now - begin) * self._pace), ticked)
                wait_until(min(due, now + CLOCK_PERIOD))
            ticked = self._tick(logged, ticked)
            if topic in self._publishers:
                self._publishers[topic].publish(raw)
            self._played += 1
        for publisher in self._publishers.values():
            publisher.wait_for_all_acked(HEARTBEAT)

    def _tick(self, logged: int, ticked: int) -> int:
        """Publish the time of the bag, ns, if that is due; return when it was published last, ns."""
        now = time.monotonic_ns()
        if self._clock is None or now - ticked < CLOCK_PERIOD:
            return ticked
        self._clock.publish(Clock(clock=time_of(logged)))
        return now

    def is_finished(self) -> bool:
        """Return whether all messages are published and have arrived. Raises what ended it before."""
        return not self.is_running()

    def conclude(self) -> None:
        """Report the played messages."""
        self._tell()

    close = Worker.stop

    def _tell(self) -> None:
        if self._played:
            self._node.get_logger().info(
                f"{self._played / len(self._rows):.0%} of {len(self._rows)} messages"
            )
        else:
            wanted = f"{self._wanted} subscription(s) of {', '.join(WAIT_FOR)}; subscribers:=0 begins at once"
            self._node.get_logger().info(f"waiting for {wanted}", throttle_duration_sec=5.0)

    def _report(self) -> NodeHealth:
        return NodeHealth(OK, "playing", {"played": self._played, "messages": len(self._rows)})


NODE = Component("replay", TABLE, ReplayNode, endless=False)
main = NODE.run

if __name__ == "__main__":
    raise SystemExit(main())
