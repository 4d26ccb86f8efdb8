"""A topic whose messages wait until somebody takes them: their numbers, read out of the serialised ones."""

import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from rclpy.callback_groups import CallbackGroup
from rclpy.node import Node
from rclpy.qos import QoSProfile

from msg_adapters.cdr import RawReader
from msg_adapters.ros import message_type
from rsea_ros.errors import ParameterError
from rsea_ros.nodes._qos import OVERRIDES, Incompatible


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
        self._kind = message_type(read.msgtype)
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
