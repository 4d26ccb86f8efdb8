"""Waiting for work at little cost: rclpy's executor spends half a millisecond of Python on each wait.

All threads of a node share one interpreter lock, so the time that the executor spends ten times a second to
find nothing to do makes a cycle at 1 kHz late.
"""

from __future__ import annotations

from rclpy.executors import Executor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node

from rsea_ros.nodes._pulse import FOR_EVER, Pulse


def anything_to_do(node: Node, executor: Executor, pulse: Pulse) -> bool:
    """Wait until a subscription, timer, client or service of an executor's node is ready, or for a pulse.

    Return whether one is ready.
    Events of publishers and subscriptions wake nobody; the executor sees to them when it runs next.
    """
    assert node.context.handle is not None
    subscriptions = [s.handle for s in node.subscriptions if executor.can_execute(s)]
    timers = [t.handle for t in node.timers if executor.can_execute(t)]
    clients = [c.handle for c in node.clients if executor.can_execute(c)]
    services = [s.handle for s in node.services if executor.can_execute(s)]
    counts = (len(subscriptions), 1, len(timers), len(clients), len(services), 0)
    waits = rclpy_implementation.WaitSet(*counts, node.context.handle)
    waits.clear_entities()
    waits.add_guard_condition(pulse.guard)
    for subscription in subscriptions:
        waits.add_subscription(subscription)
    for timer in timers:
        waits.add_timer(timer)
    for client in clients:
        waits.add_client(client)
    for service in services:
        waits.add_service(service)
    waits.wait(FOR_EVER)
    ready = waits.get_ready_entities
    return bool(ready("subscription") or ready("timer") or ready("client") or ready("service"))
