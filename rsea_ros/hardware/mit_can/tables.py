"""Ranges, states and errors of the drives: data files of models/, or one of one's own."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rsea_ros.documents import strict_yaml
from rsea_ros.documents.wording import quote
from rsea_ros.errors import ParameterError

FOLDER = Path(__file__).with_name("models")
RANGES, CODES = ("position", "velocity", "torque"), ("states", "errors")


@dataclass(frozen=True)
class DriveTable:
    """A model. position rad, velocity rad/s, torque N m: the ranges of its frames, either way.

    layout: standard (11-bit identifiers) or extended. host: identifier of the replies. ids: the least and
    largest that the protocol has room for. wraps: counts after which the angle begins anew, 0: not known.
    head: whether byte 0 of a reply is a state and an ID. replies: own where they may have the motor's ID.
    temperatures: byte and °C at a count of 0 of each; temperature: °C a count. error_byte: of the error code.
    states, errors: by code, in extended frames errors by bit. clear: what ends an error.
    registers: index and type. mode: that of the MIT frame. watchdog_unit: s.
    """

    name: str
    family: str
    layout: str
    host: int
    ids: Sequence[int]
    wraps: int
    position: float
    velocity: float
    torque: float
    head: str = ""
    replies: str = ""
    temperatures: Sequence[Sequence[int]] = ()
    temperature: float = 1.0
    error_byte: int = -1
    states: Mapping[int, str] = field(default_factory=dict)
    errors: Mapping[int, str] = field(default_factory=dict)
    clear: int = 0
    registers: Mapping[str, tuple[int, str]] = field(default_factory=dict)
    mode: int = 0
    watchdog_unit: float = math.nan

    @property
    def on(self) -> str:
        """The state in which there is torque; empty where replies tell none."""
        return self.states[max(self.states)] if self.states else ""


def _families() -> dict[str, dict[str, Any]]:
    return {path.stem: dict(strict_yaml.read(path).content) for path in sorted(FOLDER.glob("*.yaml"))}


def drive_table(model: str) -> DriveTable:
    """Return the table of a model, or of a YAML file with a family and ranges.

    Raises ParameterError for a model that nobody knows and a file that does not fit.
    """
    families = _families()
    if model.endswith((".yaml", ".yml")):
        body = dict(strict_yaml.read(Path(model)).content)
        family = str(body.pop("family", ""))
        if family not in families or sorted(body) != sorted(RANGES):
            expected = f"family ({', '.join(families)}), {', '.join(RANGES)}"
            raise ParameterError(f"parameter can_model = {quote(model)}, expected a file with {expected}")
        return _table(Path(model).stem, family, families[family], body)
    for family, content in families.items():
        if model in content["models"]:
            return _table(model, family, content, content["models"][model])
    known = ", ".join(name for content in families.values() for name in content["models"])
    raise ParameterError(f"parameter can_model = {quote(model)}, expected one of {known}, or a YAML file")


def _table(name: str, family: str, content: Mapping[str, Any], ranges: Mapping[str, float]) -> DriveTable:
    given: dict[str, Any] = {key: float(ranges[key]) for key in RANGES}
    given |= {key: value for key, value in content.items() if key != "models"}
    codes = {key: {int(code): word for code, word in content.get(key, {}).items()} for key in CODES}
    return DriveTable(name=name, family=family, **given | codes)
