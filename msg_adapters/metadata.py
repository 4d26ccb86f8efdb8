"""metadata.yaml, which rosbag2 puts beside the storage files of a bag."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePath
from typing import Any

import yaml

from msg_adapters.contents import Contents
from rsea_ros.errors import BagError

NAME = "metadata.yaml"
ROOT = "rosbag2_bagfile_information"
NOTES = "rsea_notes"
VERSION = 9


@dataclass
class Topic:
    """What the metadata tell of a topic."""

    name: str
    msgtype: str
    digest: str
    count: int = 0


def files_of(bag: Path, contents: Contents) -> list[Path]:
    """Return the files that the metadata of a bag name; empty where there are none (recorder killed).

    Topics and types are taken from the files themselves; the metadata add only the order and the notes.
    Raises BagError for metadata that name a file that is not there.
    """
    try:
        known = yaml.safe_load((bag / NAME).read_text())[ROOT]
        files = [bag / PurePath(name).name for name in known["relative_file_paths"]]
        notes = str((known.get("custom_data") or {}).get(NOTES, ""))
    except FileNotFoundError:
        contents.notes.append(f"{bag}: without {NAME} (recorder killed?), read from its files")
        return []
    except (yaml.YAMLError, KeyError, TypeError, AttributeError, UnicodeDecodeError):
        contents.notes.append(f"{bag / NAME}: not understood, read from the files beside it")
        return []
    for file in files:
        if not file.exists():
            raise BagError(f"{bag / NAME}: names {file.name}, which is not there")
    contents.notes.extend(notes.splitlines())
    return files


def text(
    file: Path, storage: str, topics: Sequence[Topic], span: tuple[int, int], notes: Sequence[str]
) -> str:
    """Return the metadata of a bag of one file; span is its first and last log time, ns."""
    known: Mapping[str, Any] = {
        "version": VERSION,
        "storage_identifier": storage,
        **_amount(topics, span),
        "topics_with_message_count": [_topic(topic) for topic in topics],
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [file.name],
        "files": [{"path": file.name, **_amount(topics, span)}],
        "custom_data": {NOTES: "\n".join(notes)} if notes else None,
        "ros_distro": "rsea_ros",
    }
    return str(yaml.safe_dump({ROOT: known}, sort_keys=False))


def _amount(topics: Sequence[Topic], span: tuple[int, int]) -> dict[str, Any]:
    return {
        "duration": {"nanoseconds": span[1] - span[0]},
        "starting_time": {"nanoseconds_since_epoch": span[0]},
        "message_count": sum(topic.count for topic in topics),
    }


def _topic(topic: Topic) -> Mapping[str, Any]:
    return {
        "topic_metadata": {
            "name": topic.name,
            "type": topic.msgtype,
            "serialization_format": "cdr",
            "offered_qos_profiles": [],
            "type_description_hash": topic.digest,
        },
        "message_count": topic.count,
    }
