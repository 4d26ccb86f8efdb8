"""Delays from stamp to reception by the middleware, in a process that subscribes."""

import struct
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
from rclpy.qos import QoSProfile

from bench.driver.bare_loop import BareLoop
from bench.processes import cpu_time
from msg_adapters.cdr import STAMP
from rsea_ros.nodes._cycle import SECOND
from rsea_ros.nodes._tap import Polled
from rsea_ros.nodes._waiter import Waiter
from rsea_ros.records.record import FloatArray

PATIENCE, SETTLE, TICK = 120.0, 4.0, 0.1
"""s."""


class Reception:
    """Listens to topics of /rsea, each with its message class and quality of service, in threads.

    delays: of each topic so far, ns.
    """

    def __init__(self, topics: Mapping[str, tuple[Any, QoSProfile]]) -> None:
        if not rclpy.ok():
            rclpy.init()
        self._node = rclpy.create_node(f"reception{time.monotonic_ns()}")
        self.delays: dict[str, list[int]] = {topic: [] for topic in topics}
        self._waiters = [self._listen(topic, *how) for topic, how in topics.items()]

    def _listen(self, topic: str, kind: Any, qos: QoSProfile) -> Waiter:
        subscription = self._node.create_subscription(
            kind, f"/rsea/{topic}", lambda message: None, qos, callback_group=Polled(), raw=True
        )
        delays = self.delays[topic]

        def take() -> None:
            while (waiting := subscription.handle.take_message(kind, True)) is not None:
                raw, info = waiting
                seconds, nanoseconds = struct.unpack_from("<iI", raw, STAMP)
                delays.append(info["received_timestamp"] - seconds * SECOND - nanoseconds)

        waiter = Waiter(self._node, [subscription], take, TICK)
        waiter.start()
        return waiter

    def close(self) -> None:
        """End the subscriptions."""
        for waiter in self._waiters:
            waiter.stop()
        self._node.destroy_node()


def beside_bare_loop(
    pid: int, topics: Mapping[str, tuple[Any, QoSProfile]], rate: float, seconds: float, folder: Path,
    priority: int,
) -> tuple[Mapping[str, FloatArray], np.ndarray, float]:  # fmt: skip
    """Measure a node beside a bare loop, once its first topic arrives and all has settled.

    Returns the delays of topics, ms, the cycles of the loop, and the share of a core.
    """
    reception = Reception(topics)
    first, deadline = next(iter(reception.delays.values())), time.monotonic() + PATIENCE
    while len(first) < 100 and time.monotonic() < deadline:
        time.sleep(TICK)
    time.sleep(SETTLE)
    for delays in reception.delays.values():
        delays.clear()
    bare, cpu = BareLoop(rate, seconds, folder, priority), cpu_time(pid)
    time.sleep(seconds)
    cpu = cpu_time(pid) - cpu
    told, cycles = {topic: np.array(d) / 1e6 for topic, d in reception.delays.items()}, bare.cycles()
    reception.close()
    return told, cycles, cpu / seconds
