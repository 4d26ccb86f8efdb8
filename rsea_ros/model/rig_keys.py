"""The keys of a rig with the values that each expects. docs/rig.md shows them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from rsea_ros.documents.fields import NEEDED, Key, table
from rsea_ros.documents.units import plain
from rsea_ros.model.rig import CLOCK_DOUBT
from rsea_ros.model.rig_fields import END_NAMES, FIELDS, LOOP_FIELDS, LOOP_LIMITS, Field
from rsea_ros.model.train import TRAINS
from rsea_ros.records.record import UNITS

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
        for end in END_NAMES
        for key, meaning in _END.items()
    },
    "spring_end.above_sensor": "share of its inertia between the spring and the F/T sensor",
}  # fmt: skip
_TRAINS = ", ".join(f"`{train}`" for train in TRAINS)
GROUPS = sorted({name.split(".")[0] for name in FIELDS} - {"controller"})
SWITCHES: Mapping[str, Sequence[Key]] = {
    "gear": (
        Key("train", _TRAINS, "planetary", "kind of gear train, and the part that is held"),
        Key("or", "list of trains", "none", "other possible kinds"),
    ),
    "spring": (Key("rigid", "true or false", "false", "there is no spring"),),
    **{end: (Key("clamped", "true or false", "false", "this end cannot move"),) for end in END_NAMES},
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
)
CLOCK = (
    Key("value", "number", NEEDED),
    Key("unit", "s", NEEDED),
    Key("doubt", "s, > 0, below 0.01 s", f"{CLOCK_DOUBT:g} s", "one sigma of `value`"),
)
CLOCK_RATE = (Key("value", "number", NEEDED), Key("unit", "ppm", NEEDED))
LOOP_KIND = Key("kind", ", ".join(f"`{k}`" for k in LOOP_FIELDS), NEEDED, "kind of the position loop")
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
        fields = [(name, field) for name, field in FIELDS.items() if name.startswith(f"{group}.")]
        parts.append(table(group, [*(_key(name, field) for name, field in fields), *SWITCHES.get(group, ())]))
    parts.append(table("sensors.CHANNEL", SENSOR))
    channels = ", ".join(f"`{n}` {plain(u)}" for n, u in UNITS.items())
    parts.append(f"Channels and their units: {channels}.\n")
    parts += [table("sensors.CHANNEL.clock", CLOCK)]
    parts += [_loop_table(kind) for kind in LOOP_FIELDS]
    parts += [table("controller", CONTROLLER), table("effects[i]", EFFECT), table("GROUP.FIELD", QUANTITY)]
    return "\n".join(parts)


def _loop_table(kind: str) -> str:
    """Return the table of a position loop whose targets command the bench."""
    keys = [(key, FIELDS[f"controller.{key}"]) for key in (*LOOP_FIELDS[kind], *LOOP_LIMITS)]
    rows = [Key(key, *_expectation(field), _LOOP_MEANINGS[key]) for key, field in keys]
    return table(f"controller, kind: {kind}", [LOOP_KIND, *rows])


def _key(name: str, field: Field) -> Key:
    expects, default = _expectation(field)
    if name.endswith("_end.inertia"):
        default = "required unless clamped"
    return Key(name.split(".")[1], expects, default, _MEANINGS[name])


def _expectation(field: Field) -> tuple[str, str]:
    """Return the expected value of a field, and its default."""
    bound = f", {'>=' if field.low_allowed else '>'} {field.low:g}" if math.isfinite(field.low) else ""
    expects = f"{plain(field.unit) or 1}{bound}"
    if field.default is None:
        return expects, NEEDED
    return expects, "infinite" if math.isinf(field.default) else f"{field.default:g}"
