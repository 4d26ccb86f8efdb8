"""A node that visits a graph: it looks, listens, calls services (transitions, triggers) and leaves."""

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from itertools import pairwise
from typing import Any

import rclpy
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions

from msg_adapters import ros
from rsea_ros.documents.wording import did_you_mean
from rsea_ros.errors import ParameterError, RseaError
from rsea_ros.nodes._run import NAMESPACE, use_sockets

DISCOVERY = 3.0
"""s within which whatever runs has been discovered."""
POLL = 0.05
"""s between two looks."""


@contextmanager
def visit(name: str) -> Iterator[Node]:
    """Yield a node that logs nowhere and offers no services; leave the graph afterwards."""
    use_sockets()
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    node = Node(name, namespace=NAMESPACE, enable_rosout=False, start_parameter_services=False)
    try:
        yield node
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


def spin(node: Node, seconds: float, is_done: Callable[[], bool]) -> None:
    """Serve a node's callbacks until something is done, for some seconds at most."""
    deadline = time.monotonic() + seconds
    while not is_done() and (left := deadline - time.monotonic()) > 0.0:
        rclpy.spin_once(node, timeout_sec=min(left, POLL))


def absolute(name: str) -> str:
    """Return the full name of a topic, a node or a service; a relative one stands in our namespace."""
    return name if name.startswith("/") else f"/{NAMESPACE}/{name}"


_ROS_TOPICS = ("/rosout", "/parameter_events")


class Listener:
    """Subscribes to any topic; publishes nothing. node: the visitor through which it does."""

    def __init__(self, node: Node) -> None:
        self._node = node

    def topics(self, seconds: float) -> list[tuple[str, str, str, str]]:
        """Return name, type, numbers of publishers and subscribers of topics discovered within some seconds.

        While there is none, keep looking: on a busy machine a discovery takes longer.
        """
        deadline = time.monotonic() + max(seconds, DISCOVERY)
        time.sleep(seconds)
        while not (topics := self._seen()) and time.monotonic() < deadline:
            time.sleep(POLL)
        return topics

    def _seen(self) -> list[tuple[str, str, str, str]]:
        node = self._node
        return [
            (name, ", ".join(types), str(node.count_publishers(name)), str(node.count_subscribers(name)))
            for name, types in node.get_topic_names_and_types()
            if name not in _ROS_TOPICS
        ]

    def rate(self, topic: str, seconds: float) -> str:
        """Return a line: messages a second over some seconds, and the longest time between two."""
        arrivals: list[float] = []
        name = self._subscribe(topic, lambda raw: arrivals.append(time.monotonic()), raw=True)
        spin(self._node, seconds, lambda: False)
        if len(arrivals) < 2:
            return f"{name}: {len(arrivals)} messages in {seconds:g} s"
        span = arrivals[-1] - arrivals[0]
        longest = max(b - a for a, b in pairwise(arrivals))
        return (
            f"{name}: {(len(arrivals) - 1) / span:.2f} Hz, longest gap {1e3 * longest:.1f} ms "
            f"({len(arrivals)} messages in {span:.2f} s)"
        )

    def messages(self, topic: str, count: int, seconds: float) -> Iterator[str]:
        """Yield the next messages of a topic as text. Raises ParameterError when none comes in time."""
        waiting: list[Any] = []
        name = self._subscribe(topic, waiting.append, raw=False)
        for number in range(count):
            spin(self._node, seconds, lambda: bool(waiting))
            if not waiting:
                raise ParameterError(f"{name}: {number} messages within {seconds:g} s, expected {count}")
            yield ros.message_text(waiting.pop(0))

    def _subscribe(self, topic: str, hear: Any, *, raw: bool) -> str:
        """Subscribe to a topic with the durability of its publisher; return its full name."""
        name = absolute(topic)
        kind = self._type_of(name)
        publishers = self._node.get_publishers_info_by_topic(name)
        is_latched = any(p.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL for p in publishers)
        qos = QoSProfile(
            depth=1000,
            reliability=ReliabilityPolicy.RELIABLE if is_latched else ReliabilityPolicy.BEST_EFFORT,
            durability=DurabilityPolicy.TRANSIENT_LOCAL if is_latched else DurabilityPolicy.VOLATILE,
        )
        self._node.create_subscription(ros.message_type(kind), name, hear, qos, raw=raw)
        return name

    def _type_of(self, name: str) -> str:
        """Return the type of a topic. Raises ParameterError when nobody publishes it."""
        known: dict[str, list[str]] = {}
        for _ in _looks(DISCOVERY):
            known = dict(self._node.get_topic_names_and_types())
            if known.get(name) and self._node.count_publishers(name):
                return known[name][0]
        near = did_you_mean(name, known)
        raise ParameterError(f"topic {name}: nobody publishes it{near} (rsea topics lists what there is)")


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
        return [name for name in self._nodes() if self._offers(name)]

    def actions(self, name: str) -> tuple[str, ...]:
        """Return what a node would do now: its triggers, and the transitions that its state allows."""
        return (*self._transitions(name), *self._triggers(name))

    def state(self, name: str) -> str:
        """Return the state of a node with a lifecycle; empty for others."""
        if not self._has_lifecycle(name):
            return ""
        return str(self._question(ros.GetState, f"{name}/get_state").current_state.label)

    def offer(self, name: str) -> tuple[str, str]:
        """Return the state of a node and what it would do now, in words, also for one that hangs."""
        try:
            return self.state(name) or "-", ", ".join(self.actions(name))
        except CallRefused:
            return "no answer", "-"

    def call(self, name: str, action: str) -> str:
        """Do one action of a node and return its answer.

        A trigger needs no more than its own service: a stop waits for no other answer. Raises ParameterError
        for an unknown node or action, CallRefused when the node does not do it.
        """
        name, before, since = self.full_name(name, action), None, 0.0
        for _ in _looks(DISCOVERY):
            if action in (triggers := self._triggers(name)):
                return self._trigger(name, action)
            if action in (transitions := self._transitions(name)):
                return self._change(name, action, transitions[action])
            if (offered := (*transitions, *triggers)) != before:
                before, since = offered, time.monotonic()
            elif time.monotonic() >= since + _UNCHANGED:  # it has shown all that it offers
                break
        state = f" while {self.state(name)}" if self._has_lifecycle(name) else ""
        near = did_you_mean(action, offered)
        raise ParameterError(f"{name}: {action!r}{state}, expected one of: {', '.join(offered)}{near}")

    def _change(self, name: str, transition: str, number: int) -> str:
        request = ros.ChangeState.Request()
        request.transition.id = number
        if not self._ask(ros.ChangeState, f"{name}/change_state", request).success:
            raise CallRefused(f"{name}: {transition} failed, it is {self.state(name)}: its log says why")
        return f"{name}: {self.state(name)}"

    def _trigger(self, name: str, service: str) -> str:
        answer = self._ask(ros.Trigger, f"{name}/{service}", ros.Trigger.Request())
        if not answer.success:
            raise CallRefused(f"{name}: {service} was refused: {answer.message}")
        return f"{name}: {answer.message or service}"

    def full_name(self, name: str, trigger: str = "") -> str:
        """Return the full name of a node. Raises ParameterError when it does not run or offers nothing.

        trigger: a service of it that is enough: on a busy machine the node is heard of seconds later.
        """
        name = absolute(name)
        if not any(
            trigger in self._triggers(name) or (name in self._nodes() and self._offers(name))
            for _ in _looks(_SEARCH)
        ):
            visitor = absolute(self._node.get_name())
            near = did_you_mean(name, [other for other in self._nodes() if other != visitor])
            raise ParameterError(f"node {name}: it does not run{near} (rsea call lists what does)")
        return name

    def _offers(self, name: str) -> bool:
        return self._has_lifecycle(name) or bool(self._triggers(name))

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
        answer = self._question(ros.GetAvailableTransitions, f"{name}/get_available_transitions")
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


def _looks(patience: float) -> Iterator[None]:
    """Yield at once, and every POLL for a time (s)."""
    deadline = time.monotonic() + patience
    yield
    while time.monotonic() < deadline:
        time.sleep(POLL)
        yield
