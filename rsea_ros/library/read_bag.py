"""`rsea.read_bag`: a recorded run, read without ROS."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from msg_adapters import TopicMap, read_record
from rsea_ros.records.record import Record


def read_bag(
    path: str | Path | Sequence[str | Path],
    *,
    namespace: str = "/rsea",
    joint: str | None = None,
    axis: str = "torque.z",
    strict: bool = True,
) -> Record:
    """Return the record of a rosbag2 directory, an .mcap or a .db3 file, or of several files of one run.

    namespace: of the topics. joint: its name, if the messages hold several. axis: axis of the actuator in the
    wrench; a leading `-` reverses it. strict: refuse commands that are missing or not finite, and correct the
    stamps; with False all samples are kept as they were recorded.
    Raises BagError with file, topic, field, value and expected value.
    Not to be confused with `rsea import`, which converts tables to bags.
    """
    return read_record(path, topics=TopicMap(namespace=namespace, joint=joint, axis=axis), strict=strict)
