"""Motor-gear units from config/design/motor_gear_units.yaml, every number with its unit and source.

`train: {value: planetary, or: [star], source: …}` names the gear train, and the others that the sources allow
where they leave it open; a number may have a `spread`, relative, one sigma.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from rsea_ros.documents import strict_yaml
from rsea_ros.documents.strict_yaml import mapping, number, only_keys, sequence, spread, text, unit
from rsea_ros.documents.units import plain
from rsea_ros.documents.wording import did_you_mean, quote
from rsea_ros.errors import FieldError, ParameterError
from rsea_ros.model.rig_file import packaged
from rsea_ros.model.train import TRAINS, Part, Train, rotor_turns, spin_inertia

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
REQUIRED = ("train", "ratio", "continuous_torque", "reflected_inertia", "reflected_damping")


PAPERS = "rd85x13-hd_cpl-25a-160"
"""The motor and gear of the paper's example."""


@dataclass(frozen=True)
class MotorGear:
    """A motor with its gear.

    trains: that of the unit, then the others that its sources allow. values: SI by name of UNITS. spreads:
    relative, one sigma, of those that are uncertain. sources: where each value and the train come from.
    beside_spring: the part that turns the spring (model/train.py).
    """

    name: str
    about: str
    trains: tuple[Train, ...]
    values: Mapping[str, float]
    spreads: Mapping[str, float]
    sources: Mapping[str, str]
    beside_spring: Part = "chassis"

    def __getitem__(self, name: str) -> float:
        return self.values[name]

    @property
    def train(self) -> Train:
        """The train that the unit is taken to have."""
        return self.trains[0]

    def with_train(self, train: Train) -> MotorGear:
        """Return the unit with this train for certain."""
        return replace(self, trains=(train,))

    @property
    def turns(self) -> float:
        """Return n, the rotor's turns for one of the part beside the spring."""
        return rotor_turns(self.train, self["ratio"], self.beside_spring)

    @property
    def spin(self) -> float:
        """The rotor's addition to J_sc between the two ends, kg m^2; negative where it turns backward."""
        return spin_inertia(self.train, self["ratio"], self["reflected_inertia"], self.beside_spring)

    @property
    def rotor_spread(self) -> float:
        """Relative one-sigma spread of the reflected inertia, and so of the spin."""
        return self.spreads.get("reflected_inertia", 0.0)

    @property
    def strongest(self) -> float:
        """Peak torque, or the continuous one where no peak is stated, N m."""
        return self.values.get("peak_torque", self["continuous_torque"])


def catalogue(path: Path | None = None) -> dict[str, MotorGear]:
    """Return the units by name. Raises ParameterError naming file, field, value and the expected value."""
    path = path or packaged("catalogue", "motor_gear_units", "design", ParameterError)
    return strict_yaml.load(
        path, "a catalogue in YAML", lambda message, field: ParameterError(message),
        lambda held: {str(n): _unit(str(n), body) for n, body in mapping(held, "catalogue").items()},
    )  # fmt: skip


def unit_named(name: str, path: Path | None = None) -> MotorGear:
    """Return a unit. Raises ParameterError for a name that the catalogue does not have."""
    units = catalogue(path)
    if name not in units:
        raise ParameterError(f"unit {name!r}, expected one of {', '.join(units)}{did_you_mean(name, units)}")
    return units[name]


def _unit(name: str, item: Any) -> MotorGear:
    body = dict(mapping(item, name))
    about = text(body.pop("about", ""), f"{name}.about")
    only_keys(body, {"train", *UNITS}, name)
    for key in REQUIRED:
        if key not in body:
            expected = f"a value in {plain(UNITS[key])}" if key in UNITS else f"one of {', '.join(TRAINS)}"
            raise FieldError(f"{name}.{key} is missing, expected {expected}", name)
    trains, origin = _trains(f"{name}.train", body.pop("train"))
    entries = {key: _entry(f"{name}.{key}", UNITS[key], entry) for key, entry in body.items()}
    return MotorGear(
        name,
        about,
        trains,
        {k: e[0] for k, e in entries.items()},
        {k: e[2] for k, e in entries.items() if e[2] > 0.0},
        {"train": origin, **{k: e[1] for k, e in entries.items()}},
    )


def train_named(name: Any, field: str) -> Train:
    """Return a train. Raises FieldError for an unknown name."""
    if name not in TRAINS:
        raise FieldError(f"{field} = {quote(name)}, expected one of {', '.join(TRAINS)}", field)
    return TRAINS[TRAINS.index(name)]


def _trains(name: str, item: Any) -> tuple[tuple[Train, ...], str]:
    body = mapping(item, name, expected="{value: planetary, source: …}")
    only_keys(body, {"value", "or", "source"}, name)
    others = sequence(body.get("or", []), f"{name}.or", "trains")
    trains = tuple(
        train_named(value, f"{name}.{key}")
        for key, value in (("value", body.get("value")), *(("or", o) for o in others))
    )
    source = text(body.get("source", ""), f"{name}.source")
    if not source:
        raise FieldError(f"{name}.source is missing, expected where the train is known from", name)
    return trains, source


def _entry(name: str, symbol: str, item: Any) -> tuple[float, str, float]:
    body = mapping(item, name, expected=f"{{value: …, unit: {symbol}, source: …}}")
    only_keys(body, {"value", "unit", "spread", "source"}, name)
    unit(body.get("unit"), f"{name}.unit", symbol)
    value, source = number(body.get("value"), name, symbol), text(body.get("source", ""), f"{name}.source")
    if not 0.0 < value < math.inf or not source:
        raise FieldError(
            f"{name} = {value:g} {plain(symbol)}, source {source!r}, expected a value > 0 and a source", name
        )
    return value, source, spread(body, name)
