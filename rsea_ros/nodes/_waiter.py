"""A thread that works when a subscription has something: rclpy's executor costs more than the work."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.subscription import Subscription

from rsea_ros.nodes._cycle import SECOND
from rsea_ros.nodes._realtime import exact_timers


class Waiter:
    """Call `work()` when a subscription (that no executor serves) has messages, and after every pause (s).

    The wait set is rclpy's own, as rclpy.wait_for_message uses it.
    """

    def __init__(
        self, node: Node, subscription: Subscription[Any], work: Callable[[], None], pause: float
    ) -> None:
        self._context, self._subscription, self._work = node.context, subscription, work
        self._pause = round(pause * SECOND)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self.error: Exception | None = None

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def stop(self) -> None:
        """End within a pause."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join()

    def running(self) -> bool:
        """Tell whether it is still at it. Raises what `work` has raised."""
        if self.error is not None:
            raise self.error
        return self._thread.is_alive()

    def _run(self) -> None:
        exact_timers()
        try:
            context, subscription = self._context.handle, self._subscription.handle
            assert context is not None
            with context, subscription:
                waits = rclpy_implementation.WaitSet(1, 0, 0, 0, 0, 0, context)
                while not self._stop.is_set():
                    waits.clear_entities()
                    waits.add_subscription(subscription)
                    waits.wait(self._pause)
                    self._work()
        except Exception as error:  # handed to the main thread by `running`
            self.error = error
