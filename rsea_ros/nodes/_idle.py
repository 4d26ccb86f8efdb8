"""Waiting for work at little cost: rclpy's executor spends half a millisecond of Python on each wait.

All threads of a node share one interpreter lock, so the time that the executor spends ten times a second to
find nothing to do makes a cycle at 1 kHz late.
"""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import ExitStack, suppress
from typing import Any

from rclpy.executors import Executor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node

from rsea_ros.nodes._pulse import FOR_EVER, Pulse


def anything_to_do(node: Node, executor: Executor, pulse: Pulse) -> bool:
    """Wait until an entity of an executor's node is ready, or for a pulse; return whether one is ready.

    Entities are its subscriptions, timers, clients and services. Events of publishers and subscriptions wake
    nobody; the executor sees to them when it runs next.
    """
    assert node.context.handle is not None
    with ExitStack() as held:
        subscriptions, timers, clients, services = (
            _hold(held, executor, entities)
            for entities in (node.subscriptions, node.timers, node.clients, node.services)
        )
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
        return any(ready(kind) for kind in ("subscription", "timer", "client", "service"))


def _hold(held: ExitStack, executor: Executor, entities: Iterable[Any]) -> list[Any]:
    """Return the handles of entities that an executor may serve, kept alive while they are waited for.

    Another thread may have destroyed some since, as a session does with the subscriptions of its last run.
    """
    handles = []
    for entity in entities:
        if executor.can_execute(entity):
            with suppress(rclpy_implementation.InvalidHandle):
                held.enter_context(entity.handle)
                handles.append(entity.handle)
    return handles
