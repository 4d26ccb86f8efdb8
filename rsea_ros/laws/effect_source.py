"""The source text of an effect file from a law.

The file is a plugin like any other (RSEA_EFFECTS): readable, editable, and complete but for the catalogue's
helpers.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass

from rsea_ros.documents.wording import in_docstring
from rsea_ros.effects import signal_table
from rsea_ros.effects.effect import Claims
from rsea_ros.laws import law as laws
from rsea_ros.laws.variables import RING

FARTHER = 3.0
"""Times the range of the data: beyond that a law keeps its value, for no datum speaks for it."""
_AT_SENSOR = {
    "theta": "s[TURNS] * s[OUTPUT_ANGLE]",
    "T": "s[FT]",
    "w": "s[OUTPUT_VELOCITY]",
    "q": "s[OUTPUT_ANGLE]",
}
_AT_COMMAND = {"w": "s[OUTPUT_VELOCITY]", "q": "s[OUTPUT_ANGLE]", "theta": "s[TURNS] * s[OUTPUT_ANGLE]"}
_ADDS = {
    "gear": "s[GEAR_TORQUE] += torque", "spring": "s[SPRING_TORQUE] += torque",
    "load": "s[HOUSING_TORQUE] += torque\n    s[DISTAL_TORQUE] += torque", "ft": "s[FT] += torque",
    "motor": "s[COMMAND] += torque", "command": "s[COMMAND] += torque\n    s[CURRENT] += torque",
}  # fmt: skip


def body_of(law: laws.Law) -> list[str]:
    lines, state, at = _variables(law), int(law.is_friction), 0
    sizes: list[str] = []
    smooth: list[str] = []
    index = {name: k for k, name in enumerate(law.parameters)}
    for part, (c, s) in zip(law.parts, law.names, strict=True):
        expression = part.term.expression
        if s:
            expression = _with_letter(expression, "a", f"p[{index[s]}]")
        if part.term.memory:
            lines += _memory(part, f"m{at}", f"p[{index[s]}]", state)
            state += _STATES[part.term.memory]
            expression = _with_letter(expression, "m", f"m{at}")
            at += 1
        (sizes if part.term.friction else smooth).append(f"p[{index[c]}] * ({expression})")
    if sizes:
        lines.append(f"x[0] = mean_friction(s, {' + '.join(sizes)}, x[0], p[{index['creep_velocity']}])")
    total = " + ".join([*smooth, *(["-x[0]"] if sizes else [])])
    return [*lines, f"torque = {total}", *_addition_lines(law, state)]


def curve_body(law: laws.Law, curve: laws.LearntCurve) -> list[str]:
    lines = [*_variables(law), f"at = ({curve.over} - FIRST) / SPACING",
             f"at = min(max(at, 0.0), {len(curve.x) - 1}.0)", f"k = min(int(at), {len(curve.x) - 2})",
             "value = CURVE[k] + (at - k) * (CURVE[k + 1] - CURVE[k])"]  # fmt: skip
    factor = {"": "", "T": " * abs(T)", "u": " * abs(u)" if law.place == "gear" else " * u", "d": " * d",
              "w": " * w" if curve.over == "t" else " * tanh(w / 2e-3)"}[curve.factor]  # fmt: skip
    if law.place == "ft" and curve.factor == "T":
        factor = " * T"
    return [*lines, f"torque = p[0] * value{factor}", *_addition_lines(law, 0)]


def _read(law: laws.Law, letter: str) -> str:
    if law.place in ("ft", "encoder"):
        return _AT_SENSOR.get(letter, f"s[{laws.READS.get(letter, '')}]")
    if letter == "h":  # one end is clamped: it stays at zero, and no torque moves it
        return "s[HOUSING_ANGLE] + s[DISTAL_ANGLE]"
    if law.place in ("command", "motor"):
        return _AT_COMMAND.get(letter, f"s[{laws.READS.get(letter, '')}]")
    return f"s[{laws.READS[letter]}]"


def is_limited(law: laws.Law, letter: str) -> bool:
    """Return whether a law keeps its value beyond the range of a variable: no wave and no gain does."""
    return letter not in ("theta", "q") and not (
        letter in ("T", "u") and law.place in ("ft", "command", "motor")
    )


def _variables(law: laws.Law) -> list[str]:
    lines, letters = [], laws.letters_of(law)
    for letter in (n for n in laws.READS if n in letters):
        limit = law.ranges[letter] * FARTHER
        value = _read(law, letter)
        within = f"min(max({value}, -{limit:.6g}), {limit:.6g})"
        lines.append(f"{letter} = {within if is_limited(law, letter) else value}")
    time = laws.names_in(law)
    if "t" in time:
        lines.append("t = s[TIME]")
    if "share" in time:
        lines.append("share = s[TIME] / s[DURATION]")
    return lines


def _addition_lines(law: laws.Law, state: int) -> list[str]:
    if law.place != "encoder":
        return [_ADDS[law.place]]
    rate = f"(torque - x[{state}]) / s[STEP] if x[{state + 1}] == 1.0 else 0.0"
    return ["s[POSITION] += torque", f"s[VELOCITY] += {rate}",
            f"x[{state}], x[{state + 1}] = torque, 1.0"]  # fmt: skip


def _with_letter(expression: str, letter: str, replaced: str) -> str:
    return re.sub(rf"\b{letter}\b", replaced, expression)


_STATES = {"": 0, "lag": 1, "heat": 1, "delay": RING + 1, "dahl": 2, "play": 2, "ring": 2}
"""How many states each memory takes."""


def _memory(part: laws.FittedTerm, name: str, shape: str, state: int) -> list[str]:
    """Return the lines that keep a memory in the states from `state` on."""
    of, kind = part.term.remembers, part.term.memory
    if kind in ("lag", "heat"):
        value = f"{of} * {of}" if kind == "heat" else of
        kept = f"x[{state}] = lagged(x[{state}], {value}, s[STEP], {shape})"
        return [kept, f"{name} = x[{state}]"]
    if kind == "ring":
        zeta = part.term.constant
        rung = f"{name} = rung(x, {state}, {of}, s[STEP], {shape}, {zeta:g})"
        if part.term.place == "spring":  # called twice a step; only the second may change a state
            return [f"{name} = x[{state}]", "if s[COMMIT] == 1.0:", f"    {rung}"]
        return [rung]
    if kind == "delay":
        return [f"{name} = from_ring(x, {state}, {of}, {shape} / s[STEP])"]
    made = f"played(x[{state}], {of}, {shape})"
    if kind == "dahl":
        made = f"bent(x[{state}], {of} - x[{state + 1}], {shape})"
    keep = f"x[{state}], x[{state + 1}] = {name}, {of}"
    at_commit = ["if s[COMMIT] == 1.0:", f"    {keep}"] if part.term.place == "spring" else [keep]
    return [f"{name} = {made}", *at_commit]


_WIDE = 10.0
"""Times the fitted value: bounds of another fit."""
_REASON = "bounds lie about the fitted value, wide enough for another machine of its kind"
_LETTERS = {"w": "the speed ω, rad/s", "q": "the angle q, rad", "theta": "the rotor's angle θ, rad",
            "d": "the deflection d, rad", "T": "the load T, N m", "u": "the command u, N m",
            "h": "the load's angle φ, rad"}  # fmt: skip


@dataclass(frozen=True)
class LawProvenance:
    """The origin of a law: date, version of the program, and the hash of every bag by name."""

    date: str
    version: str
    bags: Mapping[str, str]
    gain: str


def source_of(law: laws.Law, claims: Claims, provenance: LawProvenance) -> str:
    """Return the text of the effect file."""
    header = _docstring(law, provenance)
    lines = curve_body(law, law.curve) if law.curve is not None else body_of(law)
    body = "\n".join(f"    {line}" for line in lines)
    signature = 'def apply(s, p, x):  # type: ignore[no-untyped-def]\n    """Add the law."""'
    function = f"@compiled\n{signature}\n{body}\n"
    return f"{header}\n{_imports(law, body)}\n{_tables(law)}\n{function}\n\n{_effect(law, claims)}"


def _docstring(law: laws.Law, provenance: LawProvenance) -> str:
    kind = "A learnt law, no cause: a curve through data" if law.is_learnt else "A law that was found in data"
    letters = laws.letters_of(law)
    seen = "; ".join(f"{_LETTERS[n]}: up to {v:.3g}" for n, v in law.ranges.items() if n in letters)
    bags = "\n".join(f"    {in_docstring(name)}  sha256 {digest}" for name, digest in provenance.bags.items())
    kept = "its last value" if law.is_learnt else f"the value at {FARTHER:g} times that range"
    limited = law.is_learnt or any(is_limited(law, n) for n in letters)
    beyond = f" Beyond it the law keeps {kept}." if limited else ""
    reach = [f"Seen in the data: {seen}.{beyond}"] if seen else []
    lines = [
        f'"""{kind}: {"angle error" if law.place == "encoder" else "torque"} by {law.regressor}.',
        "", f"    {laws.equation_of(law)}", "",
        *reach,
        provenance.gain, f"Source: rsea law {provenance.version} on {provenance.date}, from", bags, '"""',
    ]  # fmt: skip
    return "\n".join(lines) + "\n"


def _tables(law: laws.Law) -> str:
    if law.curve is None:
        return ""
    values = ", ".join(f"{v:.6g}" for v in law.curve.y)
    return (f"FIRST, SPACING = {law.curve.x[0]:.9g}, {law.curve.x[1] - law.curve.x[0]:.9g}\n"
            f"CURVE = np.array([{values}])\n\n")  # fmt: skip


def _imports(law: laws.Law, body: str) -> str:
    words = laws.words_of(body)
    maths = sorted(words & {"sin", "cos", "tanh", "exp", "pi"})
    table = sorted({n for n in vars(signal_table) if n.isupper()} & words | {"Port"})
    helpers = sorted(words & {"lagged", "bent", "played", "from_ring", "rung"})
    lines = [f"from math import {', '.join(maths)}\n"] if maths else []
    lines += ["import numpy as np\n"] if law.curve is not None else []
    friction = "PRESLIDING, mean_friction" if law.is_friction else ""
    lines += [f"from rsea_ros.effects._friction import {friction}"] if friction else []
    lines += ["from rsea_ros.effects.effect import Claims, Effect, Parameter, compiled",
              f"from rsea_ros.effects.signal_table import {', '.join(table)}"]  # fmt: skip
    lines += [f"from rsea_ros.laws.variables import {', '.join(helpers)}"] if helpers else []
    return "\n".join(lines) + "\n"


def _effect(law: laws.Law, claims: Claims) -> str:
    port = {"gear": "GEAR", "load": "GEAR", "spring": "SPRING", "motor": "MOTOR", "command": "COMMAND"}.get(
        law.place, "SENSOR"
    )
    rows = "".join(f"        {row},\n" for row in _parameter_rows(law))
    letters = laws.letters_of(law) - {"u"} if law.place in ("gear", "load", "spring") else set()
    reads = [laws.READS[n] for n in laws.READS if n in letters] + ["DISTAL_ANGLE"] * ("h" in letters)
    reading = f"    reads=({', '.join(reads)},),\n" if reads else ""
    exponent = claims.amplitude_exponent
    kept = sum(_STATES[part.term.memory] for part in law.parts)
    states = int(law.is_friction) + kept + 2 * (law.place == "encoder")
    return (
        f'EFFECT = Effect(\n    name="{law.name}",\n    port=Port.{port},\n    parameters=(\n{rows}    ),\n'
        f'    claims=Claims("{claims.channel}", "{claims.parity}", amplitude_exponent={exponent}, '
        f"passive={claims.passive}),\n    function=apply,\n"
        + (f"    states={states},\n" if states else "") + reading
        + f'    about="{laws.about_of(law)}",\n    equation="{laws.equation_of(law)}",\n)\n'
    )  # fmt: skip


def _parameter_rows(law: laws.Law) -> list[str]:
    if law.curve is not None:
        return ['Parameter("size", "1", null=0.0, low=0.0, high=2.0, typical=1.0)']
    rows, seen = [], set()
    for part, (c, s) in zip(law.parts, law.names, strict=True):
        size = _WIDE * abs(part.coefficient)
        low = 0.0 if part.term.is_drag else -size
        rows.append(f'Parameter("{c}", "{part.term.unit}", null=0.0, low={low:.6g}, high={size:.6g}, '
                    f"typical={part.coefficient:.6g}, reason={_REASON!r})")  # fmt: skip
        if s and s not in seen:
            seen.add(s)
            near = {"cycles_per_revolution": 1.02, "frequency": 1.02, "mode_frequency": 1.5}.get(
                part.term.shape, _WIDE
            )
            rows.append(f'Parameter("{s}", "{part.term.shape_unit}", null={part.shape:.6g}, '
                        f"low={part.shape / near:.6g}, high={part.shape * near:.6g}, "
                        f"typical={part.shape:.6g}, "
                        f"logarithmic=True, reason={_REASON!r})")  # fmt: skip
    return [*rows, *(["PRESLIDING"] if law.is_friction else [])]
