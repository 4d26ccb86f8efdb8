"""Joints of a fleet, and the dates in the paths of their recordings."""

import hashlib
import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from datetime import datetime, timezone
from fnmatch import fnmatchcase
from functools import partial
from pathlib import Path
from typing import Any, Literal, cast, get_args

from rsea_extras.fleet import JointMapError
from rsea_ros import RseaError, load_rig
from rsea_ros.extension.base import (
    NEEDED,
    FieldError,
    Key,
    mapping,
    names,
    only_keys,
    quote,
    strict_yaml,
    table,
    text,
)
from rsea_ros.extension.rigs import ROLES, ImportMap, TopicMap, load_map, packaged, rig_text

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


_LETTERS = {"Y": r"\d{4}", "m": r"\d{2}", "d": r"\d{2}", "H": r"\d{2}", "M": r"\d{2}", "S": r"\d{2}",
            "y": r"\d{2}", "j": r"\d{3}", "f": r"\d{1,6}", "b": r"[A-Za-z]{3}"}  # fmt: skip
"""Directives of strptime that a pattern may have, as regular expressions."""
_SAMPLE = datetime(2001, 2, 3, tzinfo=timezone.utc)
"""A day that a pattern has to name."""


def date_in(path: str, pattern: str) -> datetime | None:
    """Return the last date in a path that matches a strptime pattern, or None."""
    parts = re.split(r"%(.)", pattern)
    letters = [_LETTERS.get(part, re.escape(part)) for part in parts[1::2]]
    texts = [re.escape(part) for part in parts[::2]]
    expression = "".join(text + letter for text, letter in zip(texts, [*letters, ""], strict=True))
    for found in reversed(re.findall(expression, path)):
        try:
            return datetime.strptime(found, pattern).replace(tzinfo=timezone.utc)
        except ValueError:
            continue
    return None


def names_a_day(pattern: str) -> bool:
    """Return whether a pattern has known directives only, and year, month and day among them."""
    if not set(re.findall(r"%(.?)", pattern)) <= {*_LETTERS, "%"}:
        return False
    return date_in(_SAMPLE.strftime(pattern), pattern) == _SAMPLE


Diagnose = Literal["misfit", "always", "never"]
_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]{0,63}")
_DIGITS = 16
"""Hexadecimal digits of a hash in the store."""


@dataclass(frozen=True)
class MappedJoint:
    """A joint of the map, with everything that a worker on another machine needs.

    rig: the text of the rig's file. bags: patterns of paths, none for every bag. temperature: a topic, or
    empty. date: a pattern of strptime, or empty. table: the import map where the sources are not bags.
    """

    name: str
    rig: str
    topics: TopicMap = field(default_factory=TopicMap)
    bags: tuple[str, ...] = ()
    temperature: str = ""
    date: str = ""
    table: ImportMap | None = None
    index: int | None = None
    diagnose: Diagnose = "misfit"

    def is_in(self, path: str) -> bool:
        return not self.bags or any(fnmatchcase(path, p) or fnmatchcase(path, f"*/{p}") for p in self.bags)

    @property
    def settings(self) -> str:
        """The hash of all fields that change a row: 16 hexadecimal digits."""
        table = self.table and replace(self.table, path=Path(self.table.path.name))
        parts = (self.rig, sorted(asdict(self.topics).items(), key=lambda item: item[0]), self.temperature,
                 self.date, table, self.index, self.diagnose)  # fmt: skip
        return hashlib.sha256(repr(parts).encode()).hexdigest()[:_DIGITS]


def load_joints(path: str | Path) -> tuple[MappedJoint, ...]:
    """Read a joint map. Raises JointMapError with file, line, field, value and the expected value."""
    path = Path(path)
    build = partial(_joints, folder=path.parent)
    return strict_yaml.load(path, "a joint map in YAML", JointMapError, build)


def _joints(content: Any, folder: Path) -> tuple[MappedJoint, ...]:
    body = mapping(content, "map", "a mapping with the key joints")
    only_keys(body, names(MAP), "map")
    defaults = mapping(body.get("defaults") or {}, "defaults")
    only_keys(defaults, names(JOINT), "defaults")
    joints = mapping(body.get("joints"), "joints", "a mapping of joints by name")
    if not joints:
        raise FieldError("joints: empty, expected one joint or more", "joints")
    return tuple(_joint(name, joints[name], defaults, folder) for name in joints)


def _joint(name: Any, given: Any, defaults: Mapping[str, Any], folder: Path) -> MappedJoint:
    where = f"joints.{name}"
    if not (isinstance(name, str) and _NAME.fullmatch(name)):
        expected = "a name of up to 64 letters, digits and _ - . that begins with a letter, a digit or _"
        raise FieldError(f"joint {quote(name)}: expected {expected}", where)
    stated = mapping(given or {}, where)
    only_keys(stated, names(JOINT), where)
    body = {**defaults, **stated}
    at = {key: f"{where if key in stated else 'defaults'}.{key}" for key in names(JOINT)}
    if "rig" not in body:
        raise FieldError(f"{where}: no rig, expected the name or the file of one", where)
    texts = {key: text(body[key], at[key]) for key in ("temperature", "date") if key in body}
    if "date" in texts and not names_a_day(texts["date"]):
        expected = "year, month and day as strptime reads them, such as %Y-%m-%d"
        raise FieldError(f"{at['date']} = {quote(texts['date'])}, expected {expected}", at["date"])
    return MappedJoint(
        name,
        _rig(text(body["rig"], at["rig"]), at["rig"], folder),
        _topics(body, at),
        _patterns(body.get("bags", []), at["bags"]),
        table=_table(body, at["import"], folder),
        index=_index(body.get("index"), at["index"]),
        diagnose=_diagnose(body.get("diagnose", "misfit"), at["diagnose"]),
        **texts,
    )


def _rig(name: str, field: str, folder: Path) -> str:
    """Return the text of a rig by name, or by its path from the map's folder."""
    beside = folder / name
    try:
        return rig_text(load_rig(beside if beside.is_file() else name))
    except RseaError as error:
        raise FieldError(f"{field}: {error}", field) from None


def _table(body: Mapping[str, Any], field: str, folder: Path) -> ImportMap | None:
    if "import" not in body:
        return None
    name = text(body["import"], field)
    if "bags" not in body:
        raise FieldError(f"{field} = {quote(name)}: expected bags too, which tables hold this joint", field)
    beside = folder / name
    try:
        return load_map(beside if beside.is_file() else packaged("map", name, "imports", RseaError))
    except RseaError as error:
        raise FieldError(f"{field}: {error}", field) from None


def _topics(body: Mapping[str, Any], at: Mapping[str, str]) -> TopicMap:
    renamed = mapping(body.get("topics") or {}, at["topics"])
    only_keys(renamed, names(TOPIC), at["topics"])
    stated = {role: text(topic, f"{at['topics']}.{role}") for role, topic in renamed.items()}
    stated |= {key: text(body[key], at[key]) for key in ("namespace", "joint", "axis") if key in body}
    try:
        return TopicMap(**stated)
    except RseaError as error:
        field = at["axis"] if "axis" in str(error) else at["topics"]
        raise FieldError(f"{field}: {error}", field) from None


def _patterns(value: Any, field: str) -> tuple[str, ...]:
    if isinstance(value, list):
        return tuple(text(pattern, f"{field}[{k}]") for k, pattern in enumerate(value))
    return (text(value, field),)


def _index(value: Any, field: str) -> int | None:
    if value is not None and (isinstance(value, bool) or not isinstance(value, int) or value < 0):
        raise FieldError(f"{field} = {quote(value)}, expected a whole number, 0 or more", field)
    return value


def _diagnose(value: Any, field: str) -> Diagnose:
    if value not in get_args(Diagnose):
        raise FieldError(f"{field} = {quote(value)}, expected one of {', '.join(get_args(Diagnose))}", field)
    return cast(Diagnose, value)
