"""Call the services of running nodes: transitions of a lifecycle, and triggers such as clear_fault."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from typing import Any

from rclpy.node import Node

from msg_adapters.ros import ChangeState, GetAvailableTransitions, GetState, Trigger
from rsea_ros.documents.wording import did_you_mean
from rsea_ros.errors import ParameterError, RseaError
from rsea_ros.nodes._visitor import DISCOVERY, POLL, absolute, spin

_TRIGGER, _CHANGE_STATE = "std_srvs/srv/Trigger", "lifecycle_msgs/srv/ChangeState"
_PATIENCE = 60.0
"""s that an answer may take: a driver that configures talks to its devices."""
_SEARCH = 8.0
"""s that a running node may take to be seen: on a busy machine 3 s were not always enough."""
_UNCHANGED = 0.5
"""s without a new service, after which a node has shown all that it offers."""
_QUESTIONS = 3
"""Repetitions of a question whose answer was lost: a service may be seen before it sees who asks."""
_MATCHING = 0.1
"""s that a service has to see who asks, before it is asked."""


class CallRefused(RseaError):
    """A node that answered, and did not do what was asked."""


class _NoAnswer(CallRefused):
    """A service that was asked and did not answer."""


class Caller:
    """Finds what nodes offer, and calls it. node: the visitor by which it calls."""

    def __init__(self, node: Node) -> None:
        self._node = node

    def callable_nodes(self, seconds: float) -> list[str]:
        """Return the full names of the nodes with a lifecycle or a trigger; looks for some seconds."""
        time.sleep(seconds)
        return [name for name in self._nodes() if self._has_lifecycle(name) or self._triggers(name)]

    def actions(self, name: str) -> tuple[str, ...]:
        """Return what a node would do now: its triggers, and the transitions that its state allows."""
        return (*self._transitions(name), *self._triggers(name))

    def state(self, name: str) -> str:
        """Return the state of a node with a lifecycle; empty for others."""
        if not self._has_lifecycle(name):
            return ""
        return str(self._question(GetState, f"{name}/get_state").current_state.label)

    def call(self, name: str, action: str) -> str:
        """Do one action of a node and return its answer.

        Raises ParameterError for an unknown node or action, CallRefused when the node does not do it.
        """
        name = self.full_name(name)
        self._discover(name, action)
        if action in (transitions := self._transitions(name)):
            return self._change(name, action, transitions[action])
        if action in self._triggers(name):
            return self._trigger(name, action)
        offered = self.actions(name)
        state = f" while {self.state(name)}" if self._has_lifecycle(name) else ""
        near = did_you_mean(action, offered)
        raise ParameterError(f"{name}: {action!r}{state}, expected one of: {', '.join(offered)}{near}")

    def _discover(self, name: str, action: str) -> None:
        """Return when a node offers an action, or has offered nothing new for a while."""
        before, since = None, 0.0
        for _ in _looks(DISCOVERY):
            if (offered := self.actions(name)) != before:
                before, since = offered, time.monotonic()
            if action in offered or time.monotonic() >= since + _UNCHANGED:
                return

    def _change(self, name: str, transition: str, number: int) -> str:
        request = ChangeState.Request()
        request.transition.id = number
        if not self._ask(ChangeState, f"{name}/change_state", request).success:
            raise CallRefused(f"{name}: {transition} failed, it is {self.state(name)}: its log says why")
        return f"{name}: {self.state(name)}"

    def _trigger(self, name: str, service: str) -> str:
        answer = self._ask(Trigger, f"{name}/{service}", Trigger.Request())
        if not answer.success:
            raise CallRefused(f"{name}: {service} was refused: {answer.message}")
        return f"{name}: {answer.message or service}"

    def full_name(self, name: str) -> str:
        """Return the full name of a node. Raises ParameterError when it does not run or offers nothing."""
        name = absolute(name)
        if not _await(lambda: name in self._nodes() and bool(self.actions(name)), _SEARCH):
            visitor = absolute(self._node.get_name())
            near = did_you_mean(name, [other for other in self._nodes() if other != visitor])
            raise ParameterError(f"node {name}: it does not run{near} (rsea call lists what does)")
        return name

    def _nodes(self) -> list[str]:
        pairs = self._node.get_node_names_and_namespaces()
        return sorted({f"{space.rstrip('/')}/{name}" for name, space in pairs})

    def _services(self) -> dict[str, list[str]]:
        return dict(self._node.get_service_names_and_types())

    def _triggers(self, name: str) -> tuple[str, ...]:
        start, services = f"{name}/", self._services().items()
        return tuple(s[len(start) :] for s, kinds in services if s.startswith(start) and _TRIGGER in kinds)

    def _has_lifecycle(self, name: str) -> bool:
        return _CHANGE_STATE in self._services().get(f"{name}/change_state", ())

    def _transitions(self, name: str) -> Mapping[str, int]:
        """Return the transitions that a node's state allows: number by name."""
        if not self._has_lifecycle(name):
            return {}
        answer = self._question(GetAvailableTransitions, f"{name}/get_available_transitions")
        return {each.transition.label: each.transition.id for each in answer.available_transitions}

    def _question(self, kind: Any, name: str) -> Any:
        """Return the answer of a service that changes nothing; one that gets lost is asked for again."""
        for _ in range(_QUESTIONS):
            with suppress(_NoAnswer):
                return self._ask(kind, name, kind.Request(), DISCOVERY)
        return self._ask(kind, name, kind.Request(), DISCOVERY)

    def _ask(self, kind: type, name: str, request: Any, patience: float = _PATIENCE) -> Any:
        """Return the answer of a service. Raises CallRefused when none comes within some seconds."""
        client: Any = self._node.create_client(kind, name)
        try:
            if not client.wait_for_service(DISCOVERY):
                raise CallRefused(f"{name}: nobody serves it")
            spin(self._node, _MATCHING, lambda: False)
            future = client.call_async(request)
            spin(self._node, patience, future.done)
            if not future.done():
                raise _NoAnswer(f"{name}: no answer within {patience:g} s")
            return future.result()
        finally:
            self._node.destroy_client(client)


def _await(is_true: Callable[[], bool], patience: float) -> bool:
    """Return whether something becomes true while a graph is being discovered. patience: s."""
    return any(is_true() for _ in _looks(patience))


def _looks(patience: float) -> Iterator[None]:
    """Yield at once, and every POLL for a time (s)."""
    deadline = time.monotonic() + patience
    yield
    while time.monotonic() < deadline:
        time.sleep(POLL)
        yield
