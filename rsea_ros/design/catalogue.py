"""Motor-gear units from config/design/motor_gear_units.yaml, every number with its unit and source."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rsea_ros import strict_yaml
from rsea_ros.checked import mapping, number, only_keys, text, unit
from rsea_ros.errors import FieldError, ParameterError
from rsea_ros.model.rig_file import rig_folders

FILE = "motor_gear_units.yaml"
UNITS: Mapping[str, str] = {
    "ratio": "1",
    "continuous_torque": "N m",
    "peak_torque": "N m",
    "no_load_speed": "rad/s",
    "reflected_inertia": "kg m^2",
    "reflected_damping": "N m s/rad",
    "mass": "kg",
    "diameter": "m",
}
REQUIRED = ("ratio", "continuous_torque", "reflected_inertia", "reflected_damping")


@dataclass(frozen=True)
class MotorGear:
    """A motor with its gear. values: SI by name of UNITS; sources: where each comes from."""

    name: str
    about: str
    values: Mapping[str, float]
    sources: Mapping[str, str]

    def __getitem__(self, name: str) -> float:
        return self.values[name]

    @property
    def spin(self) -> float:
        """J_m / N, kg m^2: what the rotor adds to J_sc between the two ends (planetary train)."""
        return self["reflected_inertia"] / self["ratio"]

    @property
    def strongest(self) -> float:
        """Peak torque, or the continuous one where no peak is stated, N m."""
        return self.values.get("peak_torque", self["continuous_torque"])


def catalogue(path: Path | None = None) -> dict[str, MotorGear]:
    """Return the units by name. Raises ParameterError naming file, field, value and what was expected."""
    path = path or _default_path()
    try:
        document = strict_yaml.read(path)
    except OSError as error:
        raise ParameterError(f"{path}: {error.strerror}, expected a catalogue in YAML") from None
    except FieldError as error:
        raise ParameterError(f"{path}: {error}") from None
    try:
        return {str(n): _unit(str(n), body) for n, body in mapping(document.content, "catalogue").items()}
    except FieldError as error:
        raise ParameterError(f"{path}: {document.where(error.field)}{error}") from None


def unit_named(name: str, path: Path | None = None) -> MotorGear:
    """Return a unit. Raises ParameterError for a name that the catalogue does not have."""
    units = catalogue(path)
    if name not in units:
        raise ParameterError(f"unit {name!r}, expected one of {', '.join(units)}")
    return units[name]


def _default_path() -> Path:
    folders = [folder.parent / "design" for folder in rig_folders()]
    return next((f / FILE for f in folders if (f / FILE).exists()), folders[0] / FILE)


def _unit(name: str, item: Any) -> MotorGear:
    body = dict(mapping(item, name))
    about = text(body.pop("about", ""), f"{name}.about")
    only_keys(body, set(UNITS), name)
    for key in REQUIRED:
        if key not in body:
            raise FieldError(f"{name}.{key} is missing, expected a value in {UNITS[key]}", name)
    entries = {key: _entry(f"{name}.{key}", UNITS[key], entry) for key, entry in body.items()}
    return MotorGear(
        name, about, {k: e[0] for k, e in entries.items()}, {k: e[1] for k, e in entries.items()}
    )


def _entry(name: str, symbol: str, item: Any) -> tuple[float, str]:
    body = mapping(item, name, expected=f"{{value: …, unit: {symbol}, source: …}}")
    only_keys(body, {"value", "unit", "source"}, name)
    unit(body.get("unit"), f"{name}.unit", symbol)
    value, source = number(body.get("value"), name, symbol), text(body.get("source", ""), f"{name}.source")
    if not 0.0 < value < math.inf or not source:
        raise FieldError(
            f"{name} = {value:g} {symbol}, source {source!r}, expected a value > 0 and a source", name
        )
    return value, source
