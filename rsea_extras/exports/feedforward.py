"""A rig's friction, torque ripple and gravity as a feed-forward for another controller: C99, Python, a table.

    torque = (friction + ripple + gravity) / gain, within the limits

The laws are those of the effects' files, at a constant speed, and of the step's pendulum. What the functions
take and return, with signs: USE.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import numpy as np

from rsea_ros import Rig
from rsea_ros.extension.base import ParameterError, in_docstring, plain
from rsea_ros.extension.rigs import END_NAMES, effect_named
from rsea_ros.extension.target import PRESLIDING, gear_inertia, others, train_ratio, with_structure

USE = (
    "A torque of the motor at the gear output, N·m, positive where it drives the output forward against the",
    "housing: to be added to that of your controller. It holds no state and has no acceleration in it.",
    "position, velocity: of the gear output against the housing, rad, rad/s; desired speeds have no noise.",
    "load: torque in the spring, or of a rigid joint its weight; motor: your command, N·m. Both only for",
    "friction that depends on them. What is not finite gives 0. A linear rig has m and N for rad and N·m.",
)
_SIGN = " * tanh(velocity / {creep_velocity})"
_STRIBECK = "velocity / {stribeck_velocity}"
_STRIBECK = f"torque += ({{coulomb_torque}} + {{stribeck_torque}} * exp(-({_STRIBECK}) * ({_STRIBECK})))"
LAWS: Mapping[str, tuple[str, str]] = {
    "coulomb_friction": ("friction", "torque += {torque}" + _SIGN),
    "stribeck_friction": ("friction", _STRIBECK + _SIGN),
    "lugre_friction": ("friction", f"{_STRIBECK} * tanh(velocity / {PRESLIDING.typical})"),
    "asymmetric_friction": (
        "friction", "torque += {offset} + 0.5 * fabs(velocity)"
        " * fmin(fmax({viscous_difference}, -2.0 * damping), 2.0 * damping)",
    ),
    "load_dependent_friction": ("friction", "torque += {coefficient} * fabs(load)" + _SIGN),
    "directional_load_friction": (
        "friction", "torque += (fabs({motor_coefficient} * motor + {load_coefficient} * load)"
        " + (motor * load > 0.0) * {quadratic} * fmin(motor * motor, load * load))" + _SIGN,
    ),
    "gear_loss": (
        "friction", f"torque += {{mean}} * fabs(motor) * tanh(velocity / {PRESLIDING.typical})"
        " + {difference} * motor",
    ),
    "quadratic_drag": ("friction", "torque += {coefficient} * velocity * fabs(velocity)"),
    "torque_ripple": (
        "ripple", "torque -= {amplitude} * sin({cycles_per_revolution} * turns * position + {phase})",
    ),
    "torque_constant_error": ("feedforward", "torque /= {gain}"),
    "torque_saturation": ("feedforward", "torque = fmin(fmax(torque, -{limit}), {limit})"),
    "voltage_sag": (
        "feedforward", "torque = fmin(fmax(torque, fmin(-{limit} * (1.0 + velocity / {no_load_speed}), 0.0)),"
        " fmax({limit} * (1.0 - velocity / {no_load_speed}), 0.0))",
    ),
}  # fmt: skip
"""By effect: the function that it belongs to, and its law in the words that C and Python have in common."""


Intervals = Mapping[str, tuple[float, float]]
"""95 %, SI, by name: `spring_end.gravity`, `coulomb_friction.torque`."""


@dataclass(frozen=True)
class Function:
    """A function of the feed-forward, N m. constants: name, value, and what a comment says of it."""

    name: str
    arguments: tuple[str, ...]
    about: str
    constants: list[tuple[str, float, str]] = field(default_factory=list)
    statements: list[str] = field(default_factory=list)

    def add(self, name: str, value: float, unit: str, ci95: tuple[float, float] | None = None) -> None:
        """Add a constant. unit: as it is written in a rig."""
        known = f", 95 %: {ci95[0]:.6g} to {ci95[1]:.6g}" if ci95 else ""
        self.constants.append((name, float(value), f"{plain(unit) or 1}{known}"))


def export_feedforward(
    rig: Rig, suffix: str = "", measured: Sequence[str] = (), intervals: Intervals = MappingProxyType({})
) -> others.Export:
    """Return the file of a suffix (.h, .py or .csv), otherwise all three by name.

    measured: lines that say where the values come from. intervals: beside those that the rig states.
    Raises ParameterError for another suffix.
    """
    rig = others.without_null_effects(rig)
    stated = {name: q.ci95 for name, q in rig.quantities.items() if q.ci95} | dict(intervals)
    functions, says, left = _functions(rig, stated)
    title = f"Feed-forward of {rig.name}, written by rsea export --feedforward."
    lines = [in_docstring(line) for line in (title, *measured, *others.coverage_lines(says, left))]
    prefix = others.identifier(rig.name)
    texts = {
        ".h": _header_file(functions, [*lines, "", *USE], prefix),
        ".py": _python(functions, [*lines, "", *USE]),
        ".csv": _table(functions, lines),
    }
    if suffix and suffix not in texts:
        raise ParameterError(f"--out with {suffix}, expected {', '.join(texts)}, or the name of a folder")
    named = {f"{prefix}_feedforward{kind}": text for kind, text in texts.items()}
    return others.Export("feedforward", "_feedforward", texts.get(suffix, named), says, left)


def _functions(rig: Rig, intervals: Intervals) -> tuple[list[Function], dict[str, str], dict[str, str]]:
    """Return the functions, the exported and the omitted parts."""
    friction = Function("friction", ("velocity", "load", "motor"), "Against friction, N·m.")
    ripple = Function("ripple", ("position",), "Against torque ripple over the rotor's angle, N·m.")
    gravity = Function("gravity", ("position",), "Against the weight of the end that moves, N·m.")
    arguments = ("position", "velocity", "load", "motor")
    whole = Function("feedforward", arguments, "Against all of them, within the limits, N·m.")
    functions = {one.name: one for one in (friction, ripple, gravity, whole)}
    damping = "rotor.reflected_damping"
    friction.add("damping", rig[damping], rig.unit(damping), intervals.get(damping))
    friction.statements.append("torque += damping * velocity")
    parts = ("@friction(velocity, load, motor)", "@ripple(position)", "@gravity(position)")
    whole.statements.append(f"torque += {' + '.join(parts)}")
    says = {damping: "friction"}
    left = {"inertia": f"{gear_inertia(rig):.4g} kg·m² of the rotor, and that of the link"}
    _add_gravity(gravity, rig, intervals, says, left)
    effects, guesses = others.finite_sizes(rig), {one.name for one in rig.effects if one.guess}
    for name, (place, law) in LAWS.items():
        for p in effect_named(name).parameters if name in effects else ():
            if f"{{{p.name}}}" in law:
                known = intervals.get(f"{name}.{p.name}")
                functions[place].add(f"{name}_{p.name}", effects[name][p.name], p.unit, known)
        if name in effects:
            functions[place].statements.append(law.format(**{p: f"{name}_{p}" for p in effects[name]}))
            says[name] = f"{place}, an initial guess" if name in guesses else place
    if ripple.statements:
        ripple.add("turns", train_ratio(rig), "1")
    limit = others.command_limit(rig)
    if math.isfinite(limit):
        says["torque limit"] = "feedforward"
        whole.add("limit", limit, "N m")
        whole.statements.append("torque = fmin(fmax(torque, -limit), limit)")
    elif not effects.keys() & {"torque_saturation", "voltage_sag"}:
        left["torque limit"] = "the rig states none"
    if rig.zero_unknown("position") and ripple.statements:
        left["phase of the ripple"] = "the encoder's zero differs from record to record"
    left |= others.omitted_effects(rig, says, "no torque that follows from position, velocity and load")
    return list(functions.values()), says, left


def _add_gravity(
    gravity: Function, rig: Rig, intervals: Intervals, says: dict[str, str], left: dict[str, str]
) -> None:
    """Add the weight of a pendulum, with that of gravity_error, where one end moves: q or -q from hanging."""
    errors = [one for one in rig.effects if one.name == "gravity_error"]
    hanging, free = with_structure(rig.with_effects(*errors)), [e for e in END_NAMES if rig.end_is_free(e)]
    if not any(hanging[f"{end}.gravity"] for end in free):
        return
    if len(free) == 2:
        left["gravity"] = "both ends move, and neither by the joint's angle"
        return
    weight, angle = f"{free[0]}.gravity", f"{free[0]}.gravity_angle"
    gravity.add("weight", hanging[weight], "N m", None if errors else intervals.get(weight))
    gravity.add("angle", rig[angle], "rad", intervals.get(angle))
    side = "+" if free == ["spring_end"] else "-"
    gravity.statements.append(f"torque += weight * sin(position {side} angle)")
    says |= dict.fromkeys([weight, *(one.name for one in errors)], "gravity")


def _header_file(functions: Sequence[Function], lines: Sequence[str], prefix: str) -> str:
    """Return a C99 header; the names begin with the prefix."""
    guard = f"{prefix.upper()}_FEEDFORWARD_H"
    safe = [line.replace("*/", "* /").replace("/*", "/ *").replace("??", "? ?") for line in lines]
    text = ["/*", *(f" * {line}".rstrip() for line in safe), " */", f"#ifndef {guard}", f"#define {guard}"]
    text += ["", "#include <math.h>", ""]
    for one in functions:
        takes = ", ".join(f"double {name}" for name in one.arguments)
        text += [f"/* {one.about} */", f"static inline double {prefix}_{one.name}({takes})", "{"]
        text += [f"    const double {name} = {value!r}; /* {unit} */" for name, value, unit in one.constants]
        text += ["    double torque = 0.0;", "", f"    if (!isfinite({' + '.join(one.arguments)}))"]
        text += ["        return 0.0;"]
        text += [f"    {line.replace('@', f'{prefix}_')};" for line in one.statements]
        text += ["    return torque;", "}", ""]
    return "\n".join([*text, "#endif", ""])


def _python(functions: Sequence[Function], lines: Sequence[str]) -> str:
    """Return a Python module that needs nothing but the standard library."""
    text = ['"""' + "\n".join(lines), '"""', "", "from math import exp, fabs, isfinite, sin, tanh", ""]
    text += ["fmin, fmax = min, max", ""]
    defaults = {"load": " = 0.0", "motor": " = 0.0"}
    for one in functions:
        takes = ", ".join(f"{name}: float{defaults.get(name, '')}" for name in one.arguments)
        text += ["", f"def {one.name}({takes}) -> float:", f'    """{one.about}"""']
        text += [f"    {name} = {value!r}  # {unit}" for name, value, unit in one.constants]
        text += ["    torque = 0.0", f"    if not isfinite({' + '.join(one.arguments)}):"]
        text += ["        return 0.0", *(f"    {line.replace('@', '')}" for line in one.statements)]
        text += ["    return torque", ""]
    return "\n".join(text)


FASTER = np.geomspace(1e-4, 10.0, 51)
SPEEDS = np.concatenate([-FASTER[::-1], [0.0], FASTER])
"""rad/s, of the table: from far below a usual creep velocity to beyond what joints turn."""


def _table(functions: Sequence[Function], lines: Sequence[str]) -> str:
    """Return friction over speed and load, ripple over one of its periods, and gravity over a turn."""
    held: dict[str, Any] = {}
    exec(_python(functions, []), held)  # without the lines: nothing in it comes from outside
    friction, ripple, gravity, _ = functions
    sizes = {name: value for one in functions for name, value, _ in one.constants}
    most = sizes.get("limit", 1.0) if any("load" in line for line in friction.statements) else 0.0
    loads, turn = sorted({-most, 0.0, most}), np.linspace(-math.pi, math.pi, 65)
    rows = [(0.0, w, load, "friction", held["friction"](w, load, load)) for load in loads for w in SPEEDS]
    if ripple.statements:
        period = turn / (sizes["torque_ripple_cycles_per_revolution"] * abs(sizes["turns"]))
        rows += [(q, 0.0, 0.0, "ripple", held["ripple"](q)) for q in period]
    if gravity.statements:
        rows += [(q, 0.0, 0.0, "gravity", held["gravity"](q)) for q in turn]
    text = [*(f"# {line}" for line in lines), "# SI; the motor's torque is that of the load"]
    text += ["position,velocity,load,of,torque", *(f"{q},{w},{load},{of},{y}" for q, w, load, of, y in rows)]
    return "\n".join([*text, ""])
