"""Waits that a clock cannot hold up: another thread ends them, by the steady clock.

The middleware may count the timeouts of its waits by the system clock (FastDDS built for glibc before
2.30). If that clock is set back by an hour, a wait of 0.1 s lasts an hour longer: Ctrl-C does not end the
node, and its timers rest.
"""

from __future__ import annotations

import threading
import time

from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node

FOR_EVER = -1


class Pulse:
    """Triggers `guard` every period (s) until it is closed. Only one wait set may hold it."""

    def __init__(self, node: Node, period: float) -> None:
        context = node.context.handle
        assert context is not None
        with context:
            self.guard = rclpy_implementation.GuardCondition(context)
        self._period = period
        self._is_over = False
        self._thread = threading.Thread(target=self._beat, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End the triggers."""
        self._is_over = True
        self._thread.join()
        self.guard.destroy_when_not_in_use()

    def _beat(self) -> None:
        while not self._is_over:
            time.sleep(self._period)
            with self.guard:
                self.guard.trigger_guard_condition()
