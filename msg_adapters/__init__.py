"""The only place that knows message types and bags. Importing it needs no ROS."""

from msg_adapters.bags import iterate
from msg_adapters.reading import read_record
from msg_adapters.topics import TopicMap

__all__ = ["TopicMap", "iterate", "read_record"]
