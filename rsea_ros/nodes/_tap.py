"""Raw subscriptions that keep up with any rate, polled or not, and the record of a bench from them."""

from __future__ import annotations

import sys
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from rclpy.callback_groups import CallbackGroup
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.serialization import serialize_message
from rclpy.subscription import Subscription

from msg_adapters import ros
from msg_adapters.cdr import RawReader, RawWriter
from msg_adapters.contents import Contents
from msg_adapters.reading import record_from
from msg_adapters.topic_map import JOINT_STATE, ROLES, TYPES, WRENCH, TopicMap
from rsea_ros.errors import ParameterError
from rsea_ros.nodes._qos import OVERRIDES, RECORD, RECORD_RELIABLE, Incompatible
from rsea_ros.records.record import Record


def raw_writer(template: ros.JointState | ros.WrenchStamped, *fields: str) -> RawWriter:
    """Return what writes a stamp and fields into copies of a message: 60 us less a cycle than making them."""
    kind = JOINT_STATE if isinstance(template, ros.JointState) else WRENCH
    return RawWriter(serialize_message(template), kind, *fields)


class Polled(CallbackGroup):
    """Subscriptions that no executor serves: a cycle takes the arrived messages when it needs them."""

    def can_execute(self, entity: object) -> bool:
        """Return False: never by an executor."""
        return False


@dataclass(frozen=True)
class MessageFields:
    """The numbers that are read of each message of a topic.

    fields: name and index of each number; nan for one that a message lacks. joint: name that a message with
    names must have; empty: any. most: names that it may have.
    """

    msgtype: str
    fields: tuple[tuple[str, int], ...]
    joint: str = ""
    most: int = 1


class Mailbox:
    """A polled subscription."""

    def __init__(
        self, node: Node, topic: str, read: MessageFields, qos: QoSProfile, refuse: Callable[[], None], *,
        admit: Callable[[object], bool] | None = None, keep: Callable[[int, bytes], None] | None = None,
    ) -> None:  # fmt: skip
        """refuse: called for each message that cannot be read.
        admit: decides by a publisher's identity whether a message counts that can be read; None: all do.
        keep: gets arrival (ns), bytes of what is read.
        """
        self._node, self._topic, self._refuse, self._admit = node, topic, refuse, admit
        self._keep = keep
        self._kind = ros.message_type(read.msgtype)
        self._reader = RawReader(read.msgtype, read.fields, read.joint, read.most)
        self.subscription: Any = node.create_subscription(
            self._kind, topic, lambda message: None, qos, callback_group=Polled(), raw=True,
            qos_overriding_options=OVERRIDES, event_callbacks=Incompatible(node, topic, qos),
        )  # fmt: skip

    def take(self, most: int = sys.maxsize) -> Iterator[tuple[int, Sequence[float], int]]:
        """Yield stamp (ns), numbers and instant of arrival (ns) of each message that waits.

        most: messages taken at once; of more the middleware keeps the newest.
        """
        handle = self.subscription.handle
        with handle:
            for _ in range(most):
                message = handle.take_message(self._kind, True)
                if message is None:
                    return
                try:
                    stamp, numbers = self._reader.read(message[0])
                except ParameterError as error:
                    self._refuse()
                    self._node.get_logger().error(f"{self._topic}: {error}", throttle_duration_sec=1.0)
                    continue
                if self._admit is not None and not self._admit(message[1]["publisher_gid"]["data"]):
                    continue
                if self._keep is not None:
                    self._keep(message[1]["received_timestamp"], message[0])
                yield stamp, numbers, message[1]["received_timestamp"]


class Tap:
    """Give every message of a topic, serialised, to `store(received_ns, raw)`, all that waits at once.

    count: messages so far. lost: messages that the middleware reports as lost.
    """

    def __init__(
        self, node: Node, kind: Any, topic: str, qos: QoSProfile, store: Callable[[int, bytes], None]
    ) -> None:
        self.count = self.lost = 0
        self._store = store
        self._subscription: Subscription[Any] = node.create_subscription(
            kind, topic, self._take, qos, raw=True,
            event_callbacks=Incompatible(node, topic, qos, message_lost=self._on_lost),
        )  # fmt: skip

    @property
    def topic(self) -> str:
        """The topic after remapping."""
        return self._subscription.topic_name

    def _take(self, raw: bytes, info: Any) -> None:
        self._keep(raw, info)
        handle = self._subscription.handle
        with handle:
            while (waiting := handle.take_message(self._subscription.msg_type, True)) is not None:
                self._keep(*waiting)

    def _keep(self, raw: bytes, info: Any) -> None:
        self.count += 1
        self._store(info["received_timestamp"], raw)

    def _on_lost(self, status: Any) -> None:
        self.lost = status.total_count


def heard(taps: Mapping[str, Tap]) -> tuple[str, dict[str, int], int]:
    """Return the numbers of messages in words and by name, those that there are; how many were lost."""
    counts = {name: tap.count for name, tap in taps.items() if tap.count}
    words = ", ".join(f"{count} {name}" for name, count in counts.items())
    return words, counts, sum(tap.lost for tap in taps.values())


class Ears:
    """The topics of a bench while its node lives, kept for a record.

    reliable: roles of which nothing may be lost. heard: called with the role of each message.
    """

    def __init__(
        self, node: Node, axis: str, reliable: Collection[str], heard: Callable[[str], None]
    ) -> None:
        self._heard = heard
        self.begin()
        self.taps = {
            role: Tap(
                node, ros.message_type(TYPES[role]), role, RECORD_RELIABLE if role in reliable else RECORD,
                partial(self._keep, role),
            )
            for role in ROLES
        }  # fmt: skip
        self.topics = TopicMap(**{role: tap.topic for role, tap in self.taps.items()}, axis=axis)

    def begin(self) -> None:
        """Start a new record."""
        self._contents = Contents()

    def take(self) -> Contents:
        """Return what was heard since then, and start a new record; in the executor's thread."""
        heard = self._contents
        self.begin()
        return heard

    def record(self, *, strict: bool, contents: Contents | None = None) -> Record:
        """Return the record since then, in the executor's thread, or that of contents which were taken.

        Raises BagError where none can be made.
        """
        heard = self._contents if contents is None else contents
        return record_from(heard, self.topics.topic("torque_command"), self.topics, strict=strict)

    def _keep(self, role: str, received: int, raw: bytes) -> None:
        sink = self._contents.sink(self.topics.topic(role), TYPES[role])
        assert sink is not None
        sink.log_times.append(received)
        sink.raw.append(raw)
        self._heard(role)
