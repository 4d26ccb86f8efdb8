"""The joints of a driver, and jobs that wait for a cycle."""

import re
import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

from rclpy.callback_groups import MutuallyExclusiveCallbackGroup, ReentrantCallbackGroup
from rclpy.node import Node
from rclpy.task import Future

from rsea_ros.errors import ParameterError
from rsea_ros.nodes._cycle import raise_new_threads
from rsea_ros.nodes._health import STEADY
from rsea_ros.nodes._parameters import NodeParameter

JOINTS = NodeParameter(
    "joints", [""], "names of several joints, each with topics and services under its name; [\"\"]: one",
    whole=True,
)  # fmt: skip
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")


def joint_table(table: Sequence[NodeParameter], given: Mapping[str, Any]) -> list[NodeParameter]:
    """Return the parameters JOINT.NAME of each joint; one not given for a joint is that of the node.

    given: parameters of the node by name. Raises ParameterError for impossible joints.
    """
    if JOINTS not in table:
        return []
    return [
        replace(p, name=f"{joint}.{p.name}", default=p.check(given.get(p.name, p.default)))
        for joint in joint_names(JOINTS.check(given.get(JOINTS.name, JOINTS.default)))
        for p in table
        if not p.whole
    ]


def joint_names(joints: object) -> list[str]:
    """Return the names of several joints; none where the driver has one. Raises ParameterError."""
    names = [name for name in joints if name] if isinstance(joints, list) else []
    for name in names:
        if not _NAME.fullmatch(name):
            raise ParameterError(f"parameter joints: {name!r}, expected letters, digits, _, first a letter")
        if names.count(name) > 1:
            raise ParameterError(f"parameter joints: {name} twice, expected each joint once")
    return names


def joint_values(values: Mapping[str, Any]) -> list[tuple[str, dict[str, Any]]]:
    """Return name and parameter values of each joint; one without a name where the driver has one."""
    node = {name: value for name, value in values.items() if "." not in name}
    names = joint_names(values[JOINTS.name])
    if not names:
        return [("", node)]
    return [
        (joint, node | {"joint": joint} | {
            name: values[f"{joint}.{name}"] for name in node if f"{joint}.{name}" in values
        })
        for joint in names
    ]  # fmt: skip


TICK = 0.02
"""s between two looks of the executor at whether the work is over, while there is some."""


class Jobs:
    """Threads of a node's services. group: the callback group of these services."""

    def __init__(self, node: Node) -> None:
        self.group, self._node = ReentrantCallbackGroup(), node
        self._tick = node.create_timer(TICK, self._begin, self.group, clock=STEADY)
        self._tick.cancel()
        self._threads: set[threading.Thread] = set()
        self._waiting: list[tuple[Any, ...]] = []

    def soon(self, *task: Any) -> None:
        """Let the executor do a task, a coroutine function and its arguments, also before there is one."""
        self._waiting.append(task)
        self._tick.reset()

    def _begin(self) -> None:
        while self._waiting and self._node.executor is not None:
            self._node.executor.create_task(*self._waiting.pop(0))

    def set_parameters(self) -> None:
        """Set the node's parameters in threads, too, one after the other: a design of gains takes seconds."""
        group = MutuallyExclusiveCallbackGroup()
        for service in self._node.services:
            if "/set_parameters" in service.service_name:
                service.callback, service.callback_group = partial(self._apart, service.callback), group
                group.add_entity(service)

    async def _apart(self, serve: Callable[..., Any], *request: Any) -> Any:
        return await self.do(partial(serve, *request))

    async def do(self, work: Callable[[], Any]) -> Any:
        """Return the result of the work or raise its error; the executor goes on meanwhile."""
        future: Future[Any] = Future()

        def fulfil() -> None:
            try:
                future.set_result(work())
            except Exception as error:  # raised in the coroutine of whoever waits for it
                future.set_exception(error)

        thread = threading.Thread(target=fulfil, daemon=True)
        self._threads.add(thread)
        self._tick.reset()
        thread.start()
        raise_new_threads()
        try:
            return await future
        finally:
            self._threads.discard(thread)
            if not (self._threads or self._waiting):
                self._tick.cancel()

    def join(self, timeout: float) -> None:
        """Wait for what is under way, s each."""
        for thread in list(self._threads):
            thread.join(timeout)
