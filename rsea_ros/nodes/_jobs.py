"""Work of services that takes long, each in a thread: neither the cycle nor the executor waits for it."""

from __future__ import annotations

import threading
from collections.abc import Callable

from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.node import Node
from rclpy.task import Future

from rsea_ros.nodes._health import STEADY

TICK = 0.02
"""s between two looks of the executor at whether the work is over, while there is some."""


class Jobs:
    """Threads of a node's services. group: the callback group of these services."""

    def __init__(self, node: Node) -> None:
        self.group = ReentrantCallbackGroup()
        self._tick = node.create_timer(TICK, lambda: None, self.group, clock=STEADY)
        self._tick.cancel()
        self._threads: set[threading.Thread] = set()

    async def do(self, work: Callable[[], str]) -> str:
        """Return the result of the work or raise its error; the executor goes on meanwhile."""
        future: Future[str] = Future()
        thread = threading.Thread(target=_fulfil, args=(future, work), daemon=True)
        self._threads.add(thread)
        self._tick.reset()
        thread.start()
        try:
            return str(await future)
        finally:
            self._threads.discard(thread)
            if not self._threads:
                self._tick.cancel()

    def join(self, timeout: float) -> None:
        """Wait for what is under way, s each."""
        for thread in list(self._threads):
            thread.join(timeout)


def _fulfil(future: Future[str], work: Callable[[], str]) -> None:
    try:
        future.set_result(work())
    except Exception as error:  # raised in the coroutine of whoever waits for it
        future.set_exception(error)
