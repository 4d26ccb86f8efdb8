"""The tables of docs/rig.md in Markdown: every key of a rig, what it expects, its default and its meaning."""

import math

from rsea_ros.documents.strict_yaml import NEEDED, Key, table
from rsea_ros.documents.units import plain
from rsea_ros.model import rig_document as doc
from rsea_ros.model.rig import END_NAMES, FIELDS, LOOP_FIELDS, loop_names
from rsea_ros.records.record import MEASURED, UNITS

OF_END = {
    "inertia": "inertia of the load",
    "damping": "viscous damping of the load",
    "stiffness": "stiffness to ground",
    "gravity": "m g l of a pendulum: the largest gravity torque",
    "gravity_angle": "angle of the pendulum from hanging, at position zero",
}
MEANINGS = {
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
    **{f"{end}.{key}": meaning for end in END_NAMES for key, meaning in OF_END.items()},
    "spring_end.above_sensor": "share of its inertia between the spring and the F/T sensor",
}  # fmt: skip
LOOP_MEANINGS = {
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


def tables():
    """Return the tables of docs/rig.md in Markdown."""
    parts = [table("rig", doc.TOP)]
    for group in doc.GROUPS:
        fields = [(name, field) for name, field in FIELDS.items() if name.startswith(f"{group}.")]
        keys = [*(_key(name, field) for name, field in fields), *doc.SWITCHES.get(group, ())]
        parts.append(table(group, keys))
    parts.append(table("sensors.CHANNEL", doc.SENSOR))
    channels = ", ".join(f"`{n}` {plain(UNITS[n])}" for n in MEASURED)
    parts.append(f"Channels and their units: {channels}.\n")
    parts += [table("sensors.CHANNEL.clock", doc.CLOCK), table("sensors.CHANNEL.filter", doc.FILTER)]
    parts += [_loop_table(kind) for kind in LOOP_FIELDS]
    parts += [table("controller", doc.CONTROLLER), table("effects[i]", doc.EFFECT)]
    parts += [table("conditions[i]", doc.CONDITION), table("GROUP.FIELD", doc.QUANTITY)]
    return "\n".join(parts)


def _loop_table(kind):
    """Return the table of a position loop whose targets command the bench."""
    keys = [(key, FIELDS[f"controller.{key}"]) for key in loop_names(kind)]
    rows = [Key(key, *_expectation(field), LOOP_MEANINGS[key]) for key, field in keys]
    return table(f"controller, kind: {kind}", [doc.LOOP_KIND, *rows])


def _key(name, field):
    expects, default = _expectation(field)
    if name.endswith("_end.inertia"):
        default = "required unless clamped"
    return Key(name.split(".")[1], expects, default, MEANINGS[name])


def _expectation(field):
    """Return the expected value of a field, and its default."""
    bound = f", {'>=' if field.low_allowed else '>'} {field.low:g}" if math.isfinite(field.low) else ""
    expects = f"{plain(field.unit) or 1}{bound}"
    if field.default is None:
        return expects, NEEDED
    return expects, "infinite" if math.isinf(field.default) else f"{field.default:g}"
