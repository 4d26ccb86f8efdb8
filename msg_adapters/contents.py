"""What lies in the files of a bag, before anything is decoded."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field


@dataclass
class Messages:
    """Serialised messages of one topic with their log times (ns), in the order of the file."""

    msgtype: str
    log_times: list[int] = field(default_factory=list)
    raw: list[bytes] = field(default_factory=list)


@dataclass
class Contents:
    """All topics of a file or bag, the messages of those asked for, and what happened on reading.

    wanted: topics whose messages are kept, None for all.
    """

    wanted: Collection[str] | None = None
    topics: dict[str, Messages] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)

    def sink(self, topic: str, msgtype: str) -> Messages | None:
        """Declare a topic; return where its messages go, None where nobody wants them."""
        messages = self.topics.setdefault(topic, Messages(msgtype))
        if msgtype not in messages.msgtype.split(" and "):
            messages.msgtype += f" and {msgtype}"
        return messages if self.wanted is None or topic in self.wanted else None
