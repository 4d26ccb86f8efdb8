"""What a bag contains, remarks on it, and its metadata.yaml.

A directory keeps the remarks in metadata.yaml, a single MCAP file in a metadata record named `rsea`.
"""

from __future__ import annotations

import json
import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path, PurePath
from typing import Any

import yaml

from rsea_ros.documents.wording import brief, no_utf_8
from rsea_ros.errors import BagError
from rsea_ros.records.record import Fault

AND = " and "
"""Between the types of a topic that has several."""


@dataclass
class Messages:
    """Serialised messages of one topic with their log times (ns), in the order of the file."""

    msgtype: str
    log_times: list[int] = field(default_factory=list)
    raw: list[bytes] = field(default_factory=list)


@dataclass
class Contents:
    """All topics of a file or bag, the requested messages, and faults and notes of reading.

    wanted: topics whose messages are kept, None for all.
    faults: damage, with counts and places. notes: assumptions.
    """

    wanted: Collection[str] | None = None
    topics: dict[str, Messages] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    faults: list[Fault] = field(default_factory=list)

    def wants(self, topic: str) -> bool:
        """Return whether the messages of a topic are kept."""
        return self.wanted is None or topic in self.wanted

    def sink(self, topic: str, msgtype: str) -> Messages | None:
        """Declare a topic; return where its messages go, None where nobody wants them."""
        messages = self.topics.setdefault(topic, Messages(msgtype))
        if msgtype not in messages.msgtype.split(AND):
            messages.msgtype += f"{AND}{msgtype}"
        return messages if self.wants(topic) else None

    def tell(
        self,
        kind: str,
        where: str,
        detail: str,
        size: float | None = None,
        unit: str = "",
        share: float = math.nan,
    ) -> None:
        """Add a fault of a topic or a file, once if two sources report it."""
        if not any((f.kind, f.channel, f.size) == (kind, where, size) for f in self.faults):
            self.faults.append(Fault(kind, where, share, detail, size, unit))

    def take(self, remarks: Remarks) -> None:
        """Add notes and faults that a bag keeps."""
        self.notes.extend(remarks.notes)
        self.faults.extend(remarks.faults)

    def compare(self, topic: str, expected: int, got: int, witness: str) -> None:
        """Report topics with fewer or more messages than another count says."""
        if not self.wants(topic) or got == expected:
            return
        kind = "missing_messages" if got < expected else "surplus_messages"
        share = (expected - got) / expected if got < expected else math.nan
        detail = f"{got} read, {expected} expected from {witness}"
        self.tell(kind, topic, detail, abs(expected - got), "messages", share)

    def remarks(self) -> str:
        """Return notes and faults for the text of a refusal, empty without any."""
        faults = (f"{f.kind.replace('_', ' ')}: {f.detail}" for f in self.faults)
        parts = dict.fromkeys([*self.notes, *faults])
        return f" ({'; '.join(parts)})" if parts else ""


REMARKS = "rsea"
NOTES, FAULTS = "rsea_notes", "rsea_faults"
KEPT = frozenset({"rows_left_out", "missing_values", "coarse_stamps", "out_of_order", "raw_codes"})
"""Faults that no reader of the bag could find again."""
_LONGEST, _MOST = 500, 50


@dataclass(frozen=True)
class Remarks:
    """Notes and faults of a bag."""

    notes: Sequence[str] = ()
    faults: Sequence[Fault] = ()

    def texts(self) -> dict[str, str]:
        """Return both as texts by name, those that there are."""
        kept = [[f.kind, f.channel, f.share, f.detail] for f in self.faults if f.kind in KEPT]
        texts = {NOTES: "\n".join(self.notes), FAULTS: json.dumps(kept, allow_nan=False) if kept else ""}
        return {name: text for name, text in texts.items() if text}


def remarks_of(texts: object) -> Remarks:
    """Return this project's remarks among texts by name; none of anything else."""
    found = map(texts.get, (NOTES, FAULTS)) if isinstance(texts, Mapping) else ("", "")
    notes, faults = (text if isinstance(text, str) else "" for text in found)
    lines = [brief(line, _LONGEST) for line in notes.splitlines()[:_MOST] if "\0" not in line]
    return Remarks(lines, _faults(faults))


def _faults(text: str) -> list[Fault]:
    """Return the faults of rows [kind, channel, share, detail]; of anything else none."""
    try:
        rows = json.loads(text) if text else []
    except (ValueError, RecursionError):
        return []
    faults = []
    for row in rows[:_MOST] if isinstance(rows, list) else ():
        match row:
            case [str(kind), str(channel), float() | int() as share, str(detail)] if kind in KEPT:
                whole = float(share if 0.0 <= share <= 1.0 else math.nan)
                faults.append(Fault(kind, brief(channel, _LONGEST), whole, brief(detail, _LONGEST)))
    return faults


LARGEST = 1_000_000
DEEPEST = 30

_Loader = getattr(yaml, "CBaseLoader", yaml.BaseLoader)


class NotUnderstood(ValueError):
    """A document of another form than expected, in words for people."""


def document(path: Path, data: bytes) -> Any:
    """Return the YAML content of a file as mappings, lists and texts.

    Raises BagError for more than 1 MB, aliases, and deep nesting; NotUnderstood for other text.
    """
    if len(data) > LARGEST:
        raise BagError(f"{path}: more than {LARGEST} bytes, expected the metadata of a bag")
    try:
        text = data.decode()
    except UnicodeDecodeError as error:
        raise NotUnderstood(no_utf_8(error)) from None
    try:
        depth = 0
        for event in yaml.parse(text, _Loader):
            if isinstance(event, yaml.AliasEvent):
                raise BagError(f"{path}: has an alias (*{brief(str(event.anchor))}), expected none")
            depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
            if depth > DEEPEST:
                raise BagError(f"{path}: nested more than {DEEPEST} deep, expected the metadata of a bag")
        return yaml.load(text, _Loader)
    except yaml.YAMLError as error:
        raise NotUnderstood(brief(" ".join(str(error).split()))) from None


METADATA = "metadata.yaml"
ROOT = "rosbag2_bagfile_information"
VERSION = 9


@dataclass
class Topic:
    """The metadata of a topic."""

    name: str
    msgtype: str
    digest: str
    count: int = 0
    qos: Sequence[Mapping[str, Any]] = ()


@dataclass(frozen=True)
class Known:
    """The metadata of a bag: its files, the number of messages of each topic, and remarks."""

    files: list[Path] = field(default_factory=list)
    counts: Mapping[str, int] = field(default_factory=dict)
    remarks: Remarks = field(default_factory=Remarks)


def metadata_of(bag: Path, contents: Contents) -> Known:
    """Return the metadata of a bag; empty without the file (recorder killed).

    Topics and types come from the files themselves; the metadata add the order, notes, and the number of
    messages expected in each topic.
    Raises BagError for metadata that name a missing file, and for content that no recorder writes:
    more than 1 MB, aliases, deep nesting.
    """
    path = bag / METADATA
    try:
        with path.open("rb") as opened:
            known_content = _metadata_from(bag, document(path, opened.read(LARGEST + 1)))
    except FileNotFoundError:
        contents.notes.append(f"{bag}: without {METADATA} (recorder killed?), read from its files")
        return Known()
    except BagError:
        raise
    except (TypeError, ValueError, KeyError) as error:
        contents.notes.append(f"{path}: not understood, read from the files beside it")
        contents.tell("damaged_metadata", METADATA, f"not understood ({_why(error)}), read without it")
        return Known()
    if missing := next((file for file in known_content.files if not file.exists()), None):
        raise BagError(f"{path}: names {brief(missing.name)}, which is not there")
    return known_content


def remarks_in(path: Path, data: bytes) -> Remarks:
    """Return the remarks in the metadata that a storage file holds; none where they are not understood."""
    try:
        return remarks_of(document(path, data)[ROOT]["custom_data"])
    except (BagError, TypeError, ValueError, KeyError):
        return Remarks()


def _metadata_from(bag: Path, document: Any) -> Known:
    """Raise NotUnderstood, TypeError, ValueError or KeyError for content that rosbag2 does not write."""
    root = document[ROOT] if isinstance(document, dict) else None
    if not isinstance(root, dict):
        raise NotUnderstood(f"no mapping {ROOT}")
    files = [bag / PurePath(_text_of(name)).name for name in _list_of(root["relative_file_paths"])]
    topics = [
        (topic["topic_metadata"]["name"], topic) for topic in _list_of(root["topics_with_message_count"])
    ]
    counts = {_text_of(name): _count_of(topic["message_count"]) for name, topic in topics}
    return Known(files, counts, remarks_of(root.get("custom_data")))


def _why(error: Exception) -> str:
    if isinstance(error, KeyError):
        return f"no {brief(str(error.args[0]))}"
    return brief(str(error)) if isinstance(error, NotUnderstood) else "not in the form that rosbag2 writes"


def _text_of(value: Any) -> str:
    return str(_expect(value, isinstance(value, str) and "\0" not in value, "a text"))


def _count_of(value: Any) -> int:
    is_count = isinstance(value, str) and value.isdecimal() and value.isascii() and len(value) < 19
    return int(_expect(value, is_count, "a number", "message_count "))


def _list_of(value: Any) -> Any:
    return _expect(value, isinstance(value, list), "a list")


def _expect(value: Any, is_so: bool, expected: str, name: str = "") -> Any:
    if not is_so:
        raise NotUnderstood(f"{name}{brief(repr(value))}, expected {expected}")
    return value


def metadata_text(
    file: Path, storage: str, topics: Sequence[Topic], span: tuple[int, int], remarks: Remarks,
    distribution: str = "rsea_ros",
) -> str:  # fmt: skip
    """Return the metadata of a bag of one file; span is its first and last log time, ns."""
    document: Mapping[str, Any] = {
        "version": VERSION,
        "storage_identifier": storage,
        **_amount(topics, span),
        "topics_with_message_count": [
            {
                "topic_metadata": {
                    "name": topic.name,
                    "type": topic.msgtype,
                    "serialization_format": "cdr",
                    "offered_qos_profiles": list(topic.qos),
                    "type_description_hash": topic.digest,
                },
                "message_count": topic.count,
            }
            for topic in topics
        ],
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [file.name],
        "files": [{"path": file.name, **_amount(topics, span)}],
        "custom_data": remarks.texts() or None,
        "ros_distro": distribution,
    }
    return str(yaml.safe_dump({ROOT: document}, sort_keys=False))


def _amount(topics: Sequence[Topic], span: tuple[int, int]) -> dict[str, Any]:
    return {
        "duration": {"nanoseconds": span[1] - span[0]},
        "starting_time": {"nanoseconds_since_epoch": span[0]},
        "message_count": sum(topic.count for topic in topics),
    }
