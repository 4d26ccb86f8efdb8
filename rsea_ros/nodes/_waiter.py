"""How a node waits for work: a wake-up for each message, a pulse, and idle time.

The middleware may count the timeouts of its waits by the system clock (FastDDS built for glibc before
2.30). If that clock is set back by an hour, a wait of 0.1 s lasts an hour longer: Ctrl-C does not end the
node, and its timers rest.

All threads of a node share one interpreter lock, so the time that the executor spends ten times a second to
find nothing to do makes a cycle at 1 kHz late.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterable, Sequence
from contextlib import ExitStack
from itertools import chain
from typing import Any, Literal, get_args

from rclpy.context import Context
from rclpy.executors import Executor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.subscription import Subscription

from rsea_ros.nodes._cycle import Worker

FOR_EVER = -1
Kind = Literal["subscription", "timer", "client", "service"]
KINDS: tuple[Kind, ...] = get_args(Kind)
"""Of entities, in the order of a wait set's counts."""


class Pulse:
    """Triggers `guard` every period (s) until it is closed. Only one wait set may hold it."""

    def __init__(self, context: Context, period: float) -> None:
        assert context.handle is not None
        with context.handle:
            self.guard = rclpy_implementation.GuardCondition(context.handle)
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


class Waiter(Worker):
    """Call `work()` when subscriptions (that no executor serves) have messages, and after every pause (s).

    The wait set is rclpy's own, as rclpy.wait_for_message uses it.
    """

    def __init__(
        self, node: Node, subscriptions: Sequence[Subscription[Any]], work: Callable[[], None], pause: float
    ) -> None:
        super().__init__()
        self._node, self._subscriptions, self._work = node, subscriptions, work
        self._pause = pause

    def run(self) -> None:
        """Wait and work."""
        pulse = Pulse(self._node.context, self._pause)
        try:
            context, handles = self._node.context.handle, [s.handle for s in self._subscriptions]
            assert context is not None
            with ExitStack() as kept:
                for handle in (context, pulse.guard, *handles):
                    kept.enter_context(handle)
                waits = rclpy_implementation.WaitSet(len(handles), 1, 0, 0, 0, 0, context)
                while not self.stopping.is_set():
                    waits.clear_entities()
                    waits.add_guard_condition(pulse.guard)
                    for handle in handles:
                        waits.add_subscription(handle)
                    waits.wait(FOR_EVER)
                    self._work()
        finally:
            pulse.close()


def anything_to_do(nodes: Sequence[Node], executor: Executor, pulse: Pulse) -> bool:
    """Wait until an entity of an executor's nodes is ready, or for a pulse; return whether one is ready.

    Events of publishers and subscriptions wake nobody; the executor sees to them when it runs next.
    """
    context = nodes[0].context.handle
    assert context is not None
    held: list[Any] = []
    try:
        handles = {
            kind: _hold(held, executor, chain.from_iterable(getattr(node, f"{kind}s") for node in nodes))
            for kind in KINDS
        }
        subscriptions, timers, clients, services = map(len, handles.values())
        counts = (subscriptions, 1, timers, clients, services, 0)
        waits = rclpy_implementation.WaitSet(*counts, context)
        waits.clear_entities()
        waits.add_guard_condition(pulse.guard)
        for kind, found in handles.items():
            for handle in found:
                getattr(waits, f"add_{kind}")(handle)
        waits.wait(FOR_EVER)
        return any(waits.get_ready_entities(kind) for kind in KINDS)
    finally:
        for handle in held:
            handle.__exit__(None, None, None)


def _hold(held: list[Any], executor: Executor, entities: Iterable[Any]) -> list[Any]:
    """Return the handles of entities that an executor may serve, entered, and add them to the held ones.

    Another thread may have destroyed some since, as a session does with the subscriptions of its last run. An
    ExitStack would take half of the time that a node spends on waiting.
    """
    first = len(held)
    for entity in entities:
        try:
            if executor.can_execute(entity):
                (handle := entity.handle).__enter__()
                held.append(handle)
        except rclpy_implementation.InvalidHandle:
            continue
    return held[first:]
