"""The keys of a joint map, expected values and defaults. docs/fleet.md shows them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from msg_adapters.topic_map import ROLES
from rsea_ros.documents.strict_yaml import NEEDED, Key, table

MAP = (
    Key("joints", "mapping", NEEDED, "a mapping for each joint; names have letters, digits, `_ - .`"),
    Key("defaults", "mapping", "empty", "values for every joint that does not state its own"),
)
JOINT = (
    Key("rig", "name or file", NEEDED, "a rig of config/rigs, or a file beside this map"),
    Key("bags", "pattern, or a list", "every bag", "end of the paths of its bags; `*` also matches `/`"),
    Key("namespace", "name", "`/rsea`", "namespace of the topics"),
    Key("topics", "mapping", "standard names", "other names, `role: topic`"),
    Key("joint", "name", "the only one", "name in the messages, if they hold several joints"),
    Key("axis", "`torque.z`, `-force.x`, …", "`torque.z`", "axis of the actuator in the wrench"),
    Key("temperature", "topic", "none", "a sensor_msgs/Temperature; its mean goes into the row"),
    Key("date", "such as `%Y-%m-%d`", "none", "date in the path, if stamps have none (strptime, UTC)"),
    Key("import", "name or file", "bags", "an import map for recordings that are tables, see import.md"),
    Key("index", "0 or more", "none", "number of the joint, if the cells of a table hold several"),
    Key("diagnose", "`misfit`, `always`, `never`", "`misfit`", "which bags are also diagnosed"),
)  # fmt: skip
TOPIC = tuple(Key(role, "topic", f"`{role}`") for role in ROLES)
SECTIONS: Mapping[str, Sequence[Key]] = {"map": MAP, "joints.NAME": JOINT, "joints.NAME.topics": TOPIC}


def tables() -> str:
    """Return the tables of docs/fleet.md in Markdown."""
    return "\n".join(table(section, keys) for section, keys in SECTIONS.items())
