"""The temperature of a run, of a sensor_msgs/Temperature."""

from __future__ import annotations

import math
import struct

from msg_adapters.cdr import Walk
from msg_adapters.contents import Contents

TYPE = "sensor_msgs/msg/Temperature"


def mean_temperature(contents: Contents, topic: str) -> float | None:
    """Return the mean of a topic's temperatures, °C; None where none of its messages holds a finite one."""
    messages = contents.topics.get(topic)
    if messages is None or messages.msgtype != TYPE:
        return None
    values = [value for raw in messages.raw if (value := _temperature(raw)) is not None]
    return sum(values) / len(values) if values else None


def _temperature(raw: bytes) -> float | None:
    try:
        walk = Walk(raw)
        walk.stamp_and_frame()
        first, _ = walk.doubles(1)
    except ValueError:
        return None
    value = float(struct.unpack_from(f"{walk.order}d", raw, first)[0])
    return value if math.isfinite(value) else None
