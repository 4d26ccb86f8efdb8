"""The keys of a joint map: what each expects, and what holds without it. docs/fleet.md shows them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from msg_adapters.topics import ROLES
from rsea_ros.keys import NEEDED, Key, table

MAP = (
    Key("joints", "mapping", NEEDED, "a mapping for each joint, by its name: letters, digits and `_ - .`"),
    Key("defaults", "mapping", "empty", "what holds for every joint that does not say otherwise"),
)
JOINT = (
    Key("rig", "name or file", NEEDED, "of config/rigs, or a file beside this map"),
    Key("bags", "pattern, or a list", "every bag", "the end of the paths that hold it; `*` also takes `/`"),
    Key("namespace", "name", "`/rsea`", "of the topics"),
    Key("topics", "mapping", "the contract's", "other names, `role: topic`"),
    Key("joint", "name", "the only one", "in the messages, where they hold several joints"),
    Key("axis", "`torque.z`, `-force.x`, …", "`torque.z`", "of the wrench that the actuator turns about"),
    Key("temperature", "topic", "none", "a sensor_msgs/Temperature whose mean stands in the row"),
    Key("date", "such as `%Y-%m-%d`", "none", "the date in the path, of stamps without (strptime, UTC)"),
    Key("import", "name or file", "bags", "an import map: its recordings are tables, see import.md"),
    Key("index", "0 or more", "none", "which joint, of tables whose cells hold several"),
    Key("diagnose", "`misfit`, `always`, `never`", "`misfit`", "which bags are diagnosed too"),
)  # fmt: skip
TOPIC = tuple(Key(role, "topic", f"`{role}`") for role in ROLES)
SECTIONS: Mapping[str, Sequence[Key]] = {"map": MAP, "joints.NAME": JOINT, "joints.NAME.topics": TOPIC}


def tables() -> str:
    """Return the tables of docs/fleet.md in Markdown."""
    return "\n".join(table(section, keys) for section, keys in SECTIONS.items())
