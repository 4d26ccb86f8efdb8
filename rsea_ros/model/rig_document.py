"""The rig out of its document: its keys, and the values that each expects (docs/rig.md shows them).

A value is written `{value: 0.953, unit: kg m^2, spread: 0.3, source: Table 2}`; the unit must be the one of
`rig.FIELDS`.
"""

import math
from collections.abc import Collection, Mapping, Sequence
from typing import Any

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
    table,
    text,
    unit,
)
from rsea_ros.documents.units import plain
from rsea_ros.documents.wording import quote
from rsea_ros.effects.catalogue import effect_named
from rsea_ros.errors import FieldError, RigError, RseaError
from rsea_ros.model import rig as rigs
from rsea_ros.model.train import TRAINS
from rsea_ros.records.record import MEASURED, UNITS

_END = {
    "inertia": "inertia of the load",
    "damping": "viscous damping of the load",
    "stiffness": "stiffness to ground",
    "gravity": "m g l of a pendulum: the largest gravity torque",
    "gravity_angle": "angle of the pendulum from hanging, at position zero",
}
_MEANINGS = {
    "rotor.reflected_inertia": "rotor inertia, reflected to the gear output",
    "rotor.reflected_damping": "viscous damping of motor and gear, reflected to the gear output",
    "gear.ratio": "turns of the motor for one turn of the output",
    "gear.stiffness": "stiffness of the gear train",
    "gear.damping": "damping of a gear train that gives",
    "chassis.inertia": "inertia of the spring chassis, which turns with the gear output",
    "spring.stiffness": "stiffness of the spring; required unless it is rigid",
    "spring.damping": "damping of the spring",
    "housing.inertia": "inertia of the housing, if a proximal spring holds it",
    "proximal_spring.stiffness": "stiffness between the housing and its end",
    "proximal_spring.damping": "damping of that spring",
    **{
        f"{end}.{key}": meaning
        for end in rigs.END_NAMES
        for key, meaning in _END.items()
    },
    "spring_end.above_sensor": "share of its inertia between the spring and the F/T sensor",
}  # fmt: skip
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
    Key("ft_end", "`housing_end` or `spring_end`", "`spring_end`", "the end that carries the F/T sensor"),
    Key("linear", "true or false", "false", "m, N, kg replace rad, N·m, kg·m²"),
    Key("known", "list of names such as `gear.ratio`", "none", "values that no fit may change"),
    Key("sensors", "mapping, a key for each channel", "perfect sensors", "noise, steps, clocks"),
    Key("controller", "mapping", "none", "position loop that was active during the record, see below"),
    Key(
        "hold",
        "`zero`, `first` or `band`",
        "`zero`",
        "between commands: the last one, a line, a band-limited curve",
    ),
    Key("effects", "list", "none", "active effects of the catalogue"),
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
)
CLOCK = (
    Key("value", "number", NEEDED),
    Key("unit", "s", NEEDED),
    Key("doubt", "s, > 0, below 0.01 s", f"{rigs.CLOCK_DOUBT:g} s", "one sigma of `value`"),
)
CLOCK_RATE = (Key("value", "number", NEEDED), Key("unit", "ppm", NEEDED))
LOOP_KIND = Key("kind", ", ".join(f"`{k}`" for k in rigs.LOOP_FIELDS), NEEDED, "kind of the position loop")
_LOOP_MEANINGS = {
    "k_p": "torque per error: u = k_p e + k_i int e dt - k_d dq/dt + k_f dr/dt",
    "k_i": "torque per integral of the error",
    "k_d": "damping torque per speed",
    "k_f": "feed-forward torque per speed of the target",
    "k_pos": "desired speed per error: u = k_v e_v + k_vi int e_v dt, e_v = k_pos e - dq/dt",
    "k_v": "torque per error of the speed",
    "k_vi": "torque per integral of the speed error",
    "torque_limit": "largest torque",
    "velocity_limit": "largest speed of the target (pd), largest desired speed (cascade)",
    "sample_time": "sample period of the firmware; 0: continuous",
}
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


def tables() -> str:
    """Return the tables of docs/rig.md in Markdown."""
    parts = [table("rig", TOP)]
    for group in GROUPS:
        fields = [(name, field) for name, field in rigs.FIELDS.items() if name.startswith(f"{group}.")]
        parts.append(table(group, [*(_key(name, field) for name, field in fields), *SWITCHES.get(group, ())]))
    parts.append(table("sensors.CHANNEL", SENSOR))
    channels = ", ".join(f"`{n}` {plain(u)}" for n, u in UNITS.items())
    parts.append(f"Channels and their units: {channels}.\n")
    parts += [table("sensors.CHANNEL.clock", CLOCK)]
    parts += [_loop_table(kind) for kind in rigs.LOOP_FIELDS]
    parts += [table("controller", CONTROLLER), table("effects[i]", EFFECT), table("GROUP.FIELD", QUANTITY)]
    return "\n".join(parts)


def _loop_table(kind: str) -> str:
    """Return the table of a position loop whose targets command the bench."""
    keys = [(key, rigs.FIELDS[f"controller.{key}"]) for key in (*rigs.LOOP_FIELDS[kind], *rigs.LOOP_LIMITS)]
    rows = [Key(key, *_expectation(field), _LOOP_MEANINGS[key]) for key, field in keys]
    return table(f"controller, kind: {kind}", [LOOP_KIND, *rows])


def _key(name: str, field: rigs.Field) -> Key:
    expects, default = _expectation(field)
    if name.endswith("_end.inertia"):
        default = "required unless clamped"
    return Key(name.split(".")[1], expects, default, _MEANINGS[name])


def _expectation(field: rigs.Field) -> tuple[str, str]:
    """Return the expected value of a field, and its default."""
    bound = f", {'>=' if field.low_allowed else '>'} {field.low:g}" if math.isfinite(field.low) else ""
    expects = f"{plain(field.unit) or 1}{bound}"
    if field.default is None:
        return expects, NEEDED
    return expects, "infinite" if math.isinf(field.default) else f"{field.default:g}"


_LIMITS = {"clock": 0.01, "clock_rate": 1000.0, "delay": 0.2}
"""s, ppm, s. A clock further off is no clock error but a delay of the bench, a faster one counts in other
units, and an older reading no controller and no fit can use."""


def sensors_from(body: Mapping[str, Any]) -> dict[str, rigs.Sensor]:
    """Return the sensors by channel, from the file's `sensors`."""
    only_keys(body, set(MEASURED), "sensors")
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
        floating = switch(fields, f"sensors.{name}.zero_unknown")
        clock, rate = _small(fields, name, "clock", "s"), _small(fields, name, "clock_rate", "ppm")
        if (age := _small(fields, name, "delay", "s")) < 0.0:
            stated, field = f"= {age:g} s, expected 0 or more", f"sensors.{name}.delay"
            raise RigError(f"{field}.value {stated}: a reading is no younger", field)
        sensors[name] = rigs.Sensor(noise, quantum, floating, clock, _clock_doubt(fields, name), rate, age)
    return sensors


def _clock_doubt(fields: Mapping[str, Any], name: str) -> float:
    """Return the doubt of `clock: {value: …, unit: s, doubt: …}`, s."""
    field = f"sensors.{name}.clock"
    doubt = number(fields.get("clock", {}).get("doubt", rigs.CLOCK_DOUBT), f"{field}.doubt", "s")
    if not 0.0 < doubt < _LIMITS["clock"]:
        limits = f"more than 0, less than {_LIMITS['clock']:g} s"
        raise RigError(f"{field}.doubt = {doubt:g} s, expected {limits}", field)
    return doubt


def _small(fields: Mapping[str, Any], name: str, key: str, unit_name: str) -> float:
    """Return the value of `key: {value: …, unit: …}` of a sensor, 0 where there is none.

    Raises RigError where it is not within its limit.
    """
    field, limit = f"sensors.{name}.{key}", _LIMITS[key]
    item = mapping(fields.get(key, {"value": 0.0, "unit": unit_name}), field)
    only_keys(item, names(CLOCK if key == "clock" else CLOCK_RATE), field)
    unit(item.get("unit"), f"{field}.unit", unit_name)
    value = number(item.get("value"), f"{field}.value", unit_name)
    if not abs(value) < limit:
        expected = f"expected less than {limit:g} {unit_name} either way"
        raise RigError(f"{field}.value = {value:g} {unit_name}, {expected}", field)
    return value


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
    return rigs.Rig(
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
        ft_end=text(document.get("ft_end", "spring_end"), "ft_end"),
        encoder_end=text(document.get("encoder_end", "gear_output"), "encoder_end"),
        loop=loop,
        controller=None if loop else _controller(document.get("controller")),
        hold=_hold(document.get("hold", "zero")),
        effects=effects,
    )


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
        known = ", ".join(rigs.LOOP_FIELDS)
        raise RigError(f"controller.kind = {quote(kind)}, expected one of {known}", "controller.kind")
    only_keys(item, {"kind", *rigs.LOOP_FIELDS[kind], *rigs.LOOP_LIMITS}, "controller")
    names_of = (key for key in item if key != "kind")
    return kind, {f"controller.{key}": _quantity(f"controller.{key}", item[key]) for key in names_of}


def _hold(item: Any) -> rigs.Hold:
    for hold in rigs.HOLDS:
        if item == hold:
            return hold
    raise RigError(f"hold = {quote(item)}, expected {', '.join(rigs.HOLDS)}", "hold")


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
