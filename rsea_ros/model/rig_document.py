"""The rig out of its document: its keys, and the values that each expects (docs/rig.md shows them).

A value is written `{value: 0.953, unit: kg m^2, spread: 0.3, source: Table 2}`; the unit must be the one of
`rig.FIELDS`.
"""

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import PurePath
from typing import Any, TypeVar

from rsea_ros.documents.strict_yaml import (
    NEEDED,
    Key,
    interval,
    mapping,
    names,
    number,
    only_keys,
    sequence,
    spread,
    switch,
    text,
    unit,
)
from rsea_ros.documents.units import plain, with_unit
from rsea_ros.documents.wording import did_you_mean, quote
from rsea_ros.effects.catalogue import effect_named
from rsea_ros.errors import FieldError, RigError, RseaError
from rsea_ros.model import rig as rigs
from rsea_ros.model.sensor_filter import KINDS, SensorFilter
from rsea_ros.model.train import PARTS, TRAINS
from rsea_ros.records.record import MEASURED, UNITS

T = TypeVar("T")
_TRAINS = ", ".join(f"`{train}`" for train in TRAINS)
GROUPS = sorted({name.split(".")[0] for name in rigs.FIELDS} - {"controller"})
SWITCHES: Mapping[str, Sequence[Key]] = {
    "gear": (
        Key("train", _TRAINS, "planetary", "kind of gear train, and the part that is held"),
        Key("or", "list of trains", "none", "other possible kinds"),
    ),
    "spring": (Key("rigid", "true or false", "false", "there is no spring"),),
    **{end: (Key("clamped", "true or false", "false", "this end cannot move"),) for end in rigs.END_NAMES},
}  # fmt: skip
TOP = (
    Key("name", "text", "name of the file", "name of the rig"),
    Key("about", "text", "empty", "description of the bench"),
    Key("source", "text", "empty", "source of its values"),
    Key("proximal", "`housing_end` or `spring_end`", "`housing_end`", "the paper's proximal end"),
    Key("encoder_end", "`gear_output` or `spring_end`", "`gear_output`", "the part that the encoder reads"),
    Key("beside_spring", "`chassis` or `housing`", "`chassis`", "housing: held by the gear output (RT-RSEA)"),
    Key("ft_end", "`housing_end` or `spring_end`", "`spring_end`", "the end that carries the F/T sensor"),
    Key("motion", "`simulated` or `measured`", "by the spring", "measured: something else moves the output"),
    Key("linear", "true or false", "false", "m, N, kg replace rad, N·m, kg·m²"),
    Key("known", "list of names such as `gear.ratio`", "none", "values that no fit may change"),
    Key("sensors", "mapping, a key for each channel", "perfect sensors", "noise, steps, clocks, filters"),
    Key("controller", "mapping", "none", "position loop that was active during the record, see below"),
    Key("hold", "`zero`, `first`, `band`", "`zero`", "between commands: held, a line, band-limited"),
    Key("effects", "list", "none", "active effects of the catalogue"),
    Key("conditions", "list", "none", "what differs in single records"),
    *(Key(group, "mapping", NEEDED if group == "rotor" else "defaults", "see below") for group in GROUPS),
)
QUANTITY = (
    Key("value", "number", NEEDED),
    Key("unit", "the unit of the field", NEEDED),
    Key("spread", "0 to 10, relative, one sigma", "0", "uncertainty of the value; 0: no fit changes it"),
    Key("source", "text", "empty", "source of the value"),
    Key("ci95", "[low, high]", "none", "95 % interval, written by a fit"),
)
SENSOR = (
    Key("noise", "number >= 0", "0", "standard deviation of a sample"),
    Key("quantum", "number >= 0", "0", "smallest step"),
    Key("unit", "unit of the channel", NEEDED),
    Key("source", "text", "empty", "source of the values"),
    Key("zero_unknown", "true or false", "false", "the zero differs from record to record"),
    Key("clock", "{value: …, unit: s}, below 0.01 s", "0 s", "delay of the reading after its stamp"),
    Key("clock_rate", "{value: …, unit: ppm}, below 1000 ppm", "0 ppm", "growth of that delay with time"),
    Key("delay", "{value: …, unit: s}, from 0, below 0.2 s", "0 s", "age of the reading at its stamp, known"),
    Key("filter", "mapping, see below", "none", "filter that the reading has passed, known"),
)
FILTER = [Key("kind", ", ".join(f"`{kind}`" for kind in KINDS), NEEDED, "kind of the filter")]
FILTER += [
    Key(key, f"{{value: …, unit: {unit_name}}}, {low:g} to {high:g}", f"`{kind}`: required", meaning)
    for kind, numbers in KINDS.items() for key, (unit_name, low, high, meaning) in numbers.items()
]  # fmt: skip
CLOCK = (
    Key("value", "number", NEEDED),
    Key("unit", "s", NEEDED),
    Key("doubt", "s, > 0, below 0.01 s", f"{rigs.CLOCK_DOUBT:g} s", "one sigma of `value`"),
)
CLOCK_RATE = (Key("value", "number", NEEDED), Key("unit", "ppm", NEEDED))
LOOP_KIND = Key("kind", ", ".join(f"`{k}`" for k in rigs.LOOP_FIELDS), NEEDED, "kind of the position loop")
CONTROLLER = (
    Key("k_p", "1/s, >= 0", NEEDED, "command = k_v (k_p (reference - q) - dq/dt)"),
    Key("k_v", "N·m·s/rad, >= 0", NEEDED),
    Key("limit", "N·m, > 0", "no limit", "largest command"),
    Key("source", "text", "empty", "source of the values"),
)
EFFECT = (
    Key("name", "name of an effect, each once", NEEDED),
    Key("parameters", "mapping of numbers in SI, within their bounds", NEEDED),
    Key("guess", "true or false", "false", "identify starts with it; diagnose has to find it"),
    Key("ci95", "mapping", "none", "95 % intervals, written by a diagnosis"),
)
_DIFFERENCES = "mapping of GROUP.FIELD to {value: …, unit: …}"
CONDITION = (
    Key("record", "last part of the record's path, each once", NEEDED),
    Key("values", _DIFFERENCES, "none", "replace the rig's; with a `spread` fitted for this record alone"),
    Key("added", _DIFFERENCES, "none", "on top of the rig's, or of what a fit makes of it: a payload"),
    Key("separate", "list of values with a spread", "none", "fitted for this record alone, from the rig's"),
    Key("without", "list of effects", "none", "act in the other records only, be they stated or found"),
)


_LATEST = 0.01
"""s. A clock further off than this is no clock error but a delay of the bench."""
_OLDEST = 0.2
"""s. A reading that is older than this, no controller and no fit can use."""
_FASTEST = 1000.0
"""ppm. A clock that runs faster than this counts in other units."""


def sensors_from(body: Mapping[str, Any]) -> dict[str, rigs.Sensor]:
    """Return the sensors by channel, from the file's `sensors`."""
    only_keys(body, set(MEASURED), "sensors")
    sensors = {}
    for name, item in body.items():
        at = f"sensors.{name}"
        fields = mapping(item, at)
        only_keys(fields, names(SENSOR), at)
        unit(fields.get("unit"), f"{at}.unit", UNITS[name])
        noise, quantum = (number(fields.get(k, 0.0), f"{at}.{k}", UNITS[name]) for k in ("noise", "quantum"))
        if not (0 <= noise < math.inf and 0 <= quantum < math.inf):
            stated = f"{noise:g}, {quantum:g} {plain(UNITS[name])}"
            raise RigError(f"{at} = {stated}, expected finite values >= 0", at)
        floating, clock = switch(fields, f"{at}.zero_unknown"), _clock(fields, f"{at}.clock")
        rate = _stated(fields, f"{at}.clock_rate", "ppm", _FASTEST)
        delay = _stated(fields, f"{at}.delay", "s", _OLDEST)
        if delay < 0.0:
            expected = "expected 0 or more: a reading is no younger"
            raise RigError(f"{at}.delay.value = {delay:g} s, {expected}", f"{at}.delay")
        lowpass = _filter(fields, f"{at}.filter")
        sensors[name] = rigs.Sensor(noise, quantum, floating, *clock, rate, delay, lowpass)
    return sensors


def _clock(fields: Mapping[str, Any], field: str) -> tuple[float, float]:
    """Return value and doubt, s, from `clock: {value: …, unit: s, doubt: …}`; 0 where there is none."""
    value = _stated(fields, field, "s", _LATEST, CLOCK)
    doubt = number(fields.get("clock", {}).get("doubt", rigs.CLOCK_DOUBT), f"{field}.doubt", "s")
    if not 0.0 < doubt < _LATEST:
        raise RigError(f"{field}.doubt = {doubt:g} s, expected more than 0, less than {_LATEST:g} s", field)
    return value, doubt


def _stated(
    fields: Mapping[str, Any], field: str, unit_name: str, limit: float, keys: Sequence[Key] = CLOCK_RATE
) -> float:
    """Return the value of `{value: …, unit: …}`; 0 where there is none. Raises RigError beyond a limit."""
    item = fields.get(field.split(".")[-1], {"value": 0.0, "unit": unit_name})
    value = _value(item, field, unit_name, keys)
    if not abs(value) < limit:
        expected = f"expected less than {limit:g} {unit_name} either way"
        raise RigError(f"{field}.value = {value:g} {unit_name}, {expected}", field)
    return value


def _value(item: Any, field: str, unit_name: str, keys: Sequence[Key] = CLOCK_RATE) -> float:
    body = mapping(item, field, expected=f"{{value: …, unit: {unit_name}}}")
    only_keys(body, names(keys), field)
    unit(body.get("unit"), f"{field}.unit", unit_name)
    return number(body.get("value"), f"{field}.value", unit_name)


def _filter(fields: Mapping[str, Any], field: str) -> SensorFilter | None:
    """Return the filter of a sensor from `filter: {kind: …, …}`."""
    if "filter" not in fields:
        return None
    item, numbers = mapping(fields["filter"], field), []
    if (kind := text(item.get("kind", ""), f"{field}.kind")) not in KINDS:
        raise RigError(f"{field}.kind = {quote(kind)}, expected one of {', '.join(KINDS)}", f"{field}.kind")
    only_keys(item, {"kind", *KINDS[kind]}, field)
    for key, (unit_name, low, high, meaning) in KINDS[kind].items():
        numbers.append(_value(item.get(key), f"{field}.{key}", unit_name))
        if not low <= numbers[-1] <= high or (key == "samples" and numbers[-1] % 1.0):
            expected = f"expected {with_unit(f'{low:g} to {high:g}', unit_name)}: {meaning}"
            raise RigError(f"{field}.{key} = {numbers[-1]:g}, {expected}", f"{field}.{key}")
    return SensorFilter(kind, tuple(numbers))


def check_effects(settings: Sequence[rigs.EffectSetting]) -> None:
    """Raise FieldError for an effect that is unknown or listed twice, and for a value out of bounds."""
    for i, setting in enumerate(settings):
        if setting.name in (earlier.name for earlier in settings[:i]):
            raise FieldError(f"effect {setting.name} is given twice, expected once", f"effects[{i}]")
        try:
            effect_named(setting.name).check(setting.parameters)
        except RseaError as error:
            raise FieldError(str(error), f"effects[{i}].parameters") from None


def rig_from_document(document: Mapping[str, Any], default_name: str = "rig") -> rigs.Rig:
    """Build a rig from the parsed YAML. Raises RigError naming the field."""
    try:
        return _rig(document, default_name)
    except FieldError as error:
        raise RigError(str(error), error.field) from None


def _rig(document: Mapping[str, Any], default_name: str) -> rigs.Rig:
    only_keys(document, names(TOP), "rig")
    groups = {g: mapping(document.get(g, {}), g) for g in GROUPS}
    quantities = {name: q for g, body in groups.items() for name, q in _quantities(g, body)}
    loop, gains = _loop(document.get("controller"))
    quantities |= gains
    clamped = frozenset(end for end in rigs.END_NAMES if switch(groups[end], f"{end}.clamped"))
    effects = _effects(document.get("effects", []))
    rig = rigs.Rig(
        name=text(document.get("name", default_name), "name"),
        about=text(document.get("about", ""), "about"),
        source=text(document.get("source", ""), "source"),
        quantities=quantities,
        clamped=clamped,
        rigid_spring=switch(groups["spring"], "spring.rigid"),
        linear=switch(document, "linear"),
        train=groups["gear"].get("train", "planetary"),
        other_trains=tuple(sequence(groups["gear"].get("or", []), "gear.or", "trains")),
        sensors=sensors_from(mapping(document.get("sensors", {}), "sensors")),
        known=_known_names(
            document.get("known", []),
            [*quantities, *(f"{e.name}.{p}" for e in effects for p in e.parameters)],
        ),
        proximal=text(document.get("proximal", "housing_end"), "proximal"),
        beside_spring=_one_of(PARTS, document, "beside_spring"),
        ft_end=text(document.get("ft_end", "spring_end"), "ft_end"),
        encoder_end=text(document.get("encoder_end", "gear_output"), "encoder_end"),
        motion=text(document.get("motion", ""), "motion"),
        loop=loop,
        controller=None if loop else _controller(document.get("controller")),
        hold=_one_of(rigs.HOLDS, document, "hold"),
        effects=effects,
    )
    return with_conditions(rig, document["conditions"]) if "conditions" in document else rig


def with_conditions(rig: rigs.Rig, items: Any, records: Collection[str] = ()) -> rigs.Rig:
    """Return the rig with what a document says of single records. records: that there are; none: any.

    Raises RigError naming the field.
    """
    conditions: list[rigs.Condition] = []
    for i, item in enumerate(sequence(items, "conditions", "{record: …, …}") or [None]):
        try:
            conditions.append(_condition(item, rig, records))
            if conditions[-1].record in (c.record for c in conditions[:-1]):
                raise RigError(f"record {conditions[-1].record} is given twice, expected once")
            replace(rig, conditions=tuple(conditions)).under(conditions[-1].record)  # is it a rig?
        except RseaError as error:
            raise RigError(f"conditions[{i}]: {error}", f"conditions[{i}]") from None
    return replace(rig, conditions=tuple(conditions))


def _condition(item: Any, rig: rigs.Rig, records: Collection[str]) -> rigs.Condition:
    body = mapping(item, "condition", "a mapping with the key record")
    only_keys(body, names(CONDITION), "condition")
    record = text(body.get("record"), "record")
    if not record or record not in (records or [PurePath(record).name]):
        one = f"one of {', '.join(records)}" if records else "the last part of a record's path"
        raise RigError(f"record = {quote(record)}, expected {one}{did_you_mean(record, records)}")
    if list(records).count(record) > 1:
        raise RigError(f"record = {quote(record)}: the name of several records, expected names that differ")
    values, added = (_differences(body.get(key, {}), key) for key in ("values", "added"))
    separate, without = (sequence(body.get(key, []), key, "names") for key in ("separate", "without"))
    for name in (name for name in separate if name not in rig.free()):
        free = ", ".join(rig.free()) or "it has none"
        raise RigError(f"separate: {quote(name)}, expected a value that the rig states with a spread: {free}")
    stated = [*values, *added, *separate, *(n for n, q in added.items() if q.spread)]
    for name in stated:
        if stated.count(name) > 1:
            raise RigError(f"{name}: expected once, in values, in added (without a spread) or in separate")
    of_rig = {name: rig.quantities[name] for name in separate}
    more = {name: quantity.value for name, quantity in added.items()}
    effects = frozenset(effect_named(text(name, "without")).name for name in without)
    return rigs.Condition(record, {**values, **of_rig}, more, effects)


def _differences(item: Any, key: str) -> dict[str, rigs.Quantity]:
    body = mapping(item, key, "a mapping of GROUP.FIELD to {value: …, unit: …}")
    for name in (name for name in body if name not in rigs.FIELDS):
        near = did_you_mean(str(name), rigs.FIELDS)
        raise RigError(f"{key}: {quote(name)}, expected a value such as spring_end.inertia{near}")
    return {name: _quantity(name, quantity) for name, quantity in body.items()}


def _quantities(group: str, body: Mapping[str, Any]) -> list[tuple[str, rigs.Quantity]]:
    switches = names(SWITCHES.get(group, ()))
    allowed = {name.split(".")[1] for name in rigs.FIELDS if name.startswith(group + ".")}
    only_keys(body, allowed | switches, group)
    return [
        (f"{group}.{key}", _quantity(f"{group}.{key}", item))
        for key, item in body.items()
        if key not in switches
    ]


def _quantity(name: str, item: Any) -> rigs.Quantity:
    field: rigs.Field = rigs.FIELDS[name]
    body = mapping(item, name, expected=f"{{value: …, unit: {field.unit}}}")
    only_keys(body, names(QUANTITY), name)
    unit(body.get("unit"), f"{name}.unit", field.unit)
    value = number(body.get("value"), name, field.unit)
    rigs.check_value(name, value, where="value")
    ci95 = interval(body["ci95"], f"{name}.ci95", field.unit) if "ci95" in body else None
    return rigs.Quantity(value, spread(body, name), text(body.get("source", ""), f"{name}.source"), ci95)


def _known_names(items: Any, stated: Collection[str]) -> frozenset[str]:
    for i, item in enumerate(sequence(items, "known", "field names")):
        if item not in stated:
            raise RigError(
                f"known: {quote(item)}, expected a value that this rig states: {', '.join(stated)}",
                f"known[{i}]",
            )
    return frozenset(items)


def _loop(item: Any) -> tuple[str | None, dict[str, rigs.Quantity]]:
    """Return the kind of a position loop whose targets command the bench, and its gains and limits."""
    if not isinstance(item, Mapping) or "kind" not in item:
        return None, {}
    kind = text(item["kind"], "controller.kind")
    if kind not in rigs.LOOP_FIELDS:
        expected = f"expected one of {', '.join(rigs.LOOP_FIELDS)}"
        raise RigError(f"controller.kind = {quote(kind)}, {expected}", "controller.kind")
    only_keys(item, {"kind", *rigs.loop_names(kind)}, "controller")
    names_of = (key for key in item if key != "kind")
    return kind, {f"controller.{key}": _quantity(f"controller.{key}", item[key]) for key in names_of}


def _one_of(choices: Sequence[T], document: Mapping[str, Any], key: str) -> T:
    """Return the stated one of some choices, or the first of them."""
    item = document.get(key, choices[0])
    for choice in choices:
        if item == choice:
            return choice
    raise RigError(f"{key} = {quote(item)}, expected {', '.join(map(str, choices))}", key)


def _controller(item: Any) -> rigs.PositionLoop | None:
    if item is None:
        return None
    body = mapping(item, "controller")
    only_keys(body, names(CONTROLLER), "controller")
    k_p = number(body.get("k_p"), "controller.k_p", "1/s")
    k_v = number(body.get("k_v"), "controller.k_v", "N m s/rad")
    limit = number(body.get("limit", math.inf), "controller.limit", "N m")
    for name, value, symbol in (("controller.k_p", k_p, "1/s"), ("controller.k_v", k_v, "N m s/rad")):
        if not 0.0 <= value < math.inf:
            stated, least = (f"{v:g} {plain(symbol)}" for v in (value, 0.0))
            raise RigError(f"{name} = {stated}, expected a finite value >= {least}", name)
    if limit <= 0.0:
        raise RigError(f"controller.limit = {limit:g} N·m, expected a value > 0 N·m", "controller.limit")
    return rigs.PositionLoop(k_p, k_v, limit)


def _effects(items: Any) -> tuple[rigs.EffectSetting, ...]:
    settings = []
    for i, item in enumerate(sequence(items, "effects", "{name: …, parameters: {…}}")):
        body = mapping(item, f"effects[{i}]")
        only_keys(body, names(EFFECT), f"effects[{i}]")
        parameters = mapping(body.get("parameters", {}), f"effects[{i}].parameters")
        values = {k: number(v, f"effects[{i}].{k}", "SI") for k, v in parameters.items()}
        name = text(body.get("name", ""), f"effects[{i}].name")
        settings.append(rigs.EffectSetting(name, values, switch(body, f"effects[{i}].guess")))
    check_effects(settings)
    return tuple(settings)
