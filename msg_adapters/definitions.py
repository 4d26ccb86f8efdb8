"""Text and hash of message types, which a bag carries along for readers without ROS."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, NamedTuple

from rosbags.typesys import Stores, get_typestore

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore


class Definition(NamedTuple):
    """Message definition (empty for a type that nobody knows here) and its RIHS01 hash."""

    text: str
    digest: str


@cache
def definition(msgtype: str) -> Definition:
    """Return the definition of a message type of ROS 2 Kilted."""
    store = _store()
    if msgtype not in store.types:
        return Definition("", "")
    return Definition(store.generate_msgdef(msgtype, ros_version=2)[0], store.hash_rihs01(msgtype))


@cache
def _store() -> Typestore:
    return get_typestore(Stores.ROS2_KILTED)
