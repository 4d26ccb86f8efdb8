"""The only place that knows message types and bags. Importing it needs no ROS.

Each half is imported on first use: a writer brings the message definitions along, which a reader can do
without, and a call of a node needs neither.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from msg_adapters.bags import iterate
    from msg_adapters.reading import read_record
    from msg_adapters.records import write_record, write_records
    from msg_adapters.topic_map import TopicMap
    from msg_adapters.writing import BagWriter

__all__ = ["BagWriter", "TopicMap", "iterate", "read_record", "write_record", "write_records"]
_HOMES = {
    "BagWriter": "writing", "TopicMap": "topic_map", "iterate": "bags", "read_record": "reading",
    "write_record": "records", "write_records": "records",
}  # fmt: skip


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        return getattr(import_module(f"msg_adapters.{_HOMES[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
