"""Rigs, effects, import maps and topics as files name them."""

from msg_adapters.tables import ImportMap, load_map
from msg_adapters.topic_map import ROLES, TopicMap
from rsea_ros.effects.catalogue import catalogue, effect_named
from rsea_ros.model.rig import END_NAMES
from rsea_ros.model.rig_document import rig_from_document
from rsea_ros.model.rig_file import packaged, rig_text

__all__ = [
    "END_NAMES", "ROLES", "ImportMap", "TopicMap", "catalogue", "effect_named", "load_map", "packaged",
    "rig_from_document", "rig_text",
]  # fmt: skip
