"""Whether a run has anything to do, before any worker is started."""

from __future__ import annotations

from collections.abc import Sequence

from rsea_ros.fleet.joints import MappedJoint
from rsea_ros.fleet.sources import Bag
from rsea_ros.fleet.store import Store
from rsea_ros.fleet.task import Task
from rsea_ros.version import version

Held = tuple[Bag, tuple[MappedJoint, ...]]


def is_anything_new(store: Store, held: Sequence[Held]) -> bool:
    """Return whether some recording of a joint has no row, by paths, bytes and stamps."""
    keys, recordings = store.known_rows()
    for bag, joints in held:
        recording = recordings.get((bag.url, bag.size, bag.stamp))
        if joints and recording is None:
            return True
        if any(Task(bag, joint, recording or "", version()).key not in keys for joint in joints):
            return True
    return False
