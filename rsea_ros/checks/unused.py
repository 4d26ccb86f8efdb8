"""Channels of a record that a fit of its rig makes no use of."""

from __future__ import annotations

from rsea_ros.model.inverse import is_inverse
from rsea_ros.model.rig import Rig
from rsea_ros.records.record import Record


def unused_sentence(record: Record, rig: Rig) -> str:
    """Return which channels are not used and why, empty where all are."""
    unused = ", ".join(n for n in record.channels if not _takes(rig, n))
    return f"a rig without a spring makes no use of {unused}" if unused else ""


def _takes(rig: Rig, channel: str) -> bool:
    """Return whether a fit of the rig uses a channel; a drive without a spring is judged by its torque."""
    return rig.measures(channel) and not (is_inverse(rig) and channel == "velocity")
