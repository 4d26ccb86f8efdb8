"""`rsea.read_bag`: a recorded run, read without ROS."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from msg_adapters import TopicMap, read_record
from rsea_ros.signals import Record


def read_bag(
    path: str | Path | Sequence[str | Path],
    *,
    namespace: str = "/rsea",
    joint: str | None = None,
    axis: str = "torque.z",
    strict: bool = True,
) -> Record:
    """Return the record of a rosbag2 directory, an .mcap or a .db3 file, or of several files of one run.

    namespace: of the topics. joint: which one, where the messages hold several. axis: of the wrench that the
    actuator turns about; `-` in front turns its sign. strict: refuse values that are not finite and missing
    commands; otherwise all samples come as they are, as rsea.diagnose takes them.
    Raises BagError with file, topic, field, value and what was expected.
    """
    return read_record(path, topics=TopicMap(namespace=namespace, joint=joint, axis=axis), strict=strict)
