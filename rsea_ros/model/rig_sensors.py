"""The sensors in the file of a rig: noise, quantum, and the clock of each."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from rsea_ros.documents.fields import mapping, names, number, only_keys, switch, unit
from rsea_ros.documents.units import plain
from rsea_ros.errors import RigError
from rsea_ros.model.rig import CLOCK_DOUBT, Sensor
from rsea_ros.model.rig_keys import CLOCK, CLOCK_RATE, SENSOR
from rsea_ros.records.record import UNITS

_LATEST = 0.01
"""s. A clock further off than this is no clock error but a delay of the bench."""
_FASTEST = 1000.0
"""ppm. A clock that runs faster than this counts in other units."""


def sensors_from(body: Mapping[str, Any]) -> dict[str, Sensor]:
    """Return the sensors by channel, from the file's `sensors`."""
    only_keys(body, set(UNITS), "sensors")
    sensors = {}
    for name, item in body.items():
        fields = mapping(item, f"sensors.{name}")
        only_keys(fields, names(SENSOR), f"sensors.{name}")
        unit(fields.get("unit"), f"sensors.{name}.unit", UNITS[name])
        noise, quantum = (
            number(fields.get(k, 0.0), f"sensors.{name}.{k}", UNITS[name]) for k in ("noise", "quantum")
        )
        if not (0 <= noise < math.inf and 0 <= quantum < math.inf):
            raise RigError(
                f"sensors.{name} = {noise:g}, {quantum:g} {plain(UNITS[name])}, expected finite values >= 0",
                f"sensors.{name}",
            )
        floating, clock = switch(fields, f"sensors.{name}.zero_unknown"), _clock(fields, name)
        sensors[name] = Sensor(noise, quantum, floating, *clock, _clock_rate(fields, name))
    return sensors


def _clock(fields: Mapping[str, Any], name: str) -> tuple[float, float]:
    """Return value and doubt, s, from `clock: {value: …, unit: s, doubt: …}`; 0 where there is none."""
    field = f"sensors.{name}.clock"
    item = mapping(fields.get("clock", {"value": 0.0, "unit": "s"}), field)
    only_keys(item, names(CLOCK), field)
    value = _small(item, field, "s", _LATEST)
    doubt = number(item.get("doubt", CLOCK_DOUBT), f"{field}.doubt", "s")
    if not 0.0 < doubt < _LATEST:
        raise RigError(f"{field}.doubt = {doubt:g} s, expected more than 0, less than {_LATEST:g} s", field)
    return value, doubt


def _clock_rate(fields: Mapping[str, Any], name: str) -> float:
    """Return ppm from `clock_rate: {value: …, unit: ppm}`; 0 where there is none."""
    field = f"sensors.{name}.clock_rate"
    item = mapping(fields.get("clock_rate", {"value": 0.0, "unit": "ppm"}), field)
    only_keys(item, names(CLOCK_RATE), field)
    return _small(item, field, "ppm", _FASTEST)


def _small(item: Mapping[str, Any], field: str, unit_name: str, limit: float) -> float:
    """Return the value of `{value: …, unit: …}`. Raises RigError where it is not within the limit."""
    unit(item.get("unit"), f"{field}.unit", unit_name)
    value = number(item.get("value"), f"{field}.value", unit_name)
    if not abs(value) < limit:
        expected = f"expected less than {limit:g} {unit_name} either way"
        raise RigError(f"{field}.value = {value:g} {unit_name}, {expected}", field)
    return value
