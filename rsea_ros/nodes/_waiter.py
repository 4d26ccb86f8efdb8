"""A thread that works when subscriptions have something: rclpy's executor costs more than the work."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from typing import Any

from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.subscription import Subscription

from rsea_ros.nodes._pulse import FOR_EVER, Pulse
from rsea_ros.nodes._realtime import exact_timers


class Waiter:
    """Call `work()` when subscriptions (that no executor serves) have messages, and after every pause (s).

    The wait set is rclpy's own, as rclpy.wait_for_message uses it.
    """

    def __init__(
        self, node: Node, subscriptions: Sequence[Subscription[Any]], work: Callable[[], None], pause: float
    ) -> None:
        self._node, self._subscriptions, self._work = node, subscriptions, work
        self._pause = pause
        self._stop = threading.Event()
        self.thread = threading.Thread(target=self._run, daemon=True)
        self.error: Exception | None = None

    def start(self) -> None:
        """Begin."""
        self.thread.start()

    def stop(self) -> None:
        """End within a pause."""
        self._stop.set()
        if self.thread.is_alive():
            self.thread.join()

    def is_running(self) -> bool:
        """Return whether it still runs. Raises the error of `work`."""
        if self.error is not None:
            raise self.error
        return self.thread.is_alive()

    def _run(self) -> None:
        exact_timers()
        pulse = Pulse(self._node, self._pause)
        try:
            context, handles = self._node.context.handle, [s.handle for s in self._subscriptions]
            assert context is not None
            with ExitStack() as kept:
                for handle in (context, pulse.guard, *handles):
                    kept.enter_context(handle)
                waits = rclpy_implementation.WaitSet(len(handles), 1, 0, 0, 0, 0, context)
                while not self._stop.is_set():
                    waits.clear_entities()
                    waits.add_guard_condition(pulse.guard)
                    for handle in handles:
                        waits.add_subscription(handle)
                    waits.wait(FOR_EVER)
                    self._work()
        except Exception as error:  # handed to the main thread by `running`
            self.error = error
        finally:
            pulse.close()
