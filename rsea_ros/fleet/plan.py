"""Whether a run has anything to do, before any worker is started."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from rsea_ros.fleet.joints import MappedJoint
from rsea_ros.fleet.sources import Bag
from rsea_ros.fleet.store import Store
from rsea_ros.fleet.task import Task
from rsea_ros.version import version

Held = tuple[Bag, tuple[MappedJoint, ...]]


def is_anything_new(store: Store, held: Sequence[Held]) -> bool:
    """Return whether some recording of a joint has no row, by paths, bytes and stamps."""
    return any(_new(store, held))


def count_new(store: Store, held: Sequence[Held]) -> int:
    """Return how many rows are to be made, by paths, bytes and stamps."""
    return sum(_new(store, held))


def _new(store: Store, held: Sequence[Held]) -> Iterator[bool]:
    """Yield for each joint of each recording whether it has no row."""
    keys, recordings = store.known_rows()
    for bag, joints in held:
        recording = recordings.get((bag.url, bag.size, bag.stamp))
        for joint in joints:
            yield recording is None or Task(bag, joint, recording, version()).key not in keys
