"""The only place that knows message types and bags. Importing it needs no ROS.

The writing half is imported on first use: it brings the message definitions along, which a reader can
do without.
"""

from typing import TYPE_CHECKING, Any

from msg_adapters.bags import iterate
from msg_adapters.reading import read_record
from msg_adapters.topic_map import TopicMap

if TYPE_CHECKING:
    from msg_adapters.records import write_record, write_records
    from msg_adapters.writing import BagWriter

__all__ = ["BagWriter", "TopicMap", "iterate", "read_record", "write_record", "write_records"]


def __getattr__(name: str) -> Any:
    if name in ("write_record", "write_records"):
        from msg_adapters import records

        return getattr(records, name)
    if name == "BagWriter":
        from msg_adapters.writing import BagWriter

        return BagWriter
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
