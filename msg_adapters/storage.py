"""The common interface of both file formats for a writer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Protocol

from rsea_ros.records.record import IntArray


class Storage(Protocol):
    """One file of a bag being written; times are log times in ns. Raises OSError when the disk is full."""

    path: Path

    def add(self, topic: str, msgtype: str) -> int:
        """Declare a topic; return its key."""

    def write(self, key: int, log_time: int, raw: bytes) -> None:
        """Append a serialised message."""

    def write_all(self, keys: IntArray, log_times: IntArray, raws: Sequence[bytes]) -> None:
        """Append serialised messages; keys, log_times: shape (n,)."""

    def flush(self) -> None:
        """Pass written data to the system, where they survive the end of this process."""

    def sync(self) -> None:
        """Wait until flushed data are on the disk, where they survive a power cut too."""

    def remark(self, texts: Mapping[str, str], metadata: str) -> None:
        """Keep texts by name in the file; metadata: the same in metadata.yaml of rosbag2."""

    def close(self) -> None:
        """Write the rest and the index."""

    def abort(self) -> None:
        """Close the file; flushed data stay."""
