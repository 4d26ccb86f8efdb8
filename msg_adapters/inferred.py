"""A torque that no sensor has measured: the driver's `ft` of a spring that a second encoder measures."""

from __future__ import annotations

from msg_adapters.cdr import Walk
from msg_adapters.contents import Contents
from msg_adapters.topic_map import TopicMap

STAMP_SIZE = 8
"""Bytes of a header before its frame_id."""


def is_inferred(contents: Contents, topics: TopicMap) -> bool:
    """Return whether `ft` is a rig's stiffness times `deflection`: it has that one's frame_id, no sensor's.

    A fit to both would find the very stiffness that was put in.
    """
    frames = [_frame(contents, topics.topic(role)) for role in ("ft", "deflection")]
    return bool(frames[0]) and frames[0] == frames[1]


def _frame(contents: Contents, topic: str) -> str:
    """Return the frame_id of the first message of a topic, empty where it has none."""
    messages = contents.topics.get(topic)
    if messages is None or not messages.raw:
        return ""
    try:
        walk = Walk(messages.raw[0])
        walk.skip(STAMP_SIZE)
        return walk.read_text()
    except ValueError:  # damaged; the decoder reports it
        return ""
