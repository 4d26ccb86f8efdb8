"""Raw subscriptions that keep up with any rate: each callback takes all that waits, not one message."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription


class Tap:
    """Give every message of a topic, serialised, to `store(received_ns, raw)`.

    count: messages so far. lost: messages that the middleware reports as lost.
    """

    def __init__(
        self, node: Node, kind: Any, topic: str, qos: QoSProfile, store: Callable[[int, bytes], None]
    ) -> None:
        self.count = self.lost = 0
        self._store = store
        self._subscription: Subscription[Any] = node.create_subscription(
            kind, topic, self._take, qos, raw=True,
            event_callbacks=SubscriptionEventCallbacks(message_lost=self._on_lost),
        )  # fmt: skip

    @property
    def topic(self) -> str:
        """The topic after remapping."""
        return self._subscription.topic_name

    def _take(self, raw: bytes, info: Any) -> None:
        self._keep(raw, info)
        handle = self._subscription.handle
        with handle:
            while (waiting := handle.take_message(self._subscription.msg_type, True)) is not None:
                self._keep(*waiting)

    def _keep(self, raw: bytes, info: Any) -> None:
        self.count += 1
        self._store(info["received_timestamp"], raw)

    def _on_lost(self, status: Any) -> None:
        self.lost = status.total_count
