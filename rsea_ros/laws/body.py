"""The lines of a law's function: its variables, memories, terms, and where their sum acts."""

from __future__ import annotations

import re

from rsea_ros.laws.law import FittedTerm, Law
from rsea_ros.laws.memory import RING
from rsea_ros.laws.variable_places import READS, letters_of, time_letters

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


def body_of(law: Law) -> str:
    lines, state, at = _variables(law), 0, 0
    sizes: list[str] = []
    smooth: list[str] = []
    index: dict[str, int] = {}
    for k, name in enumerate(law.parameters):
        index[name] = k
    if law.is_friction:
        state = 1
    for part, (c, s) in zip(law.parts, law.names, strict=True):
        expression = part.term.expression
        if s:
            expression = _with_letter(expression, "a", f"p[{index[s]}]")
        if part.term.memory:
            made, state = _memory(part, f"m{at}", f"p[{index[s]}]", state)
            lines += made
            expression = _with_letter(expression, "m", f"m{at}")
            at += 1
        (sizes if part.term.friction else smooth).append(f"p[{index[c]}] * ({expression})")
    if sizes:
        lines.append(f"x[0] = mean_friction(s, {' + '.join(sizes)}, x[0], p[{index['creep_velocity']}])")
    total = " + ".join([*smooth, *(["-x[0]"] if sizes else [])])
    lines += [f"torque = {total}", *_addition_lines(law, state)]
    return "\n".join(f"    {line}" for line in lines)


def curve_body(law: Law) -> str:
    curve = law.curve
    assert curve is not None
    lines = [*_variables(law), f"at = ({curve.over} - FIRST) / SPACING",
             f"at = min(max(at, 0.0), {len(curve.x) - 1}.0)", f"k = min(int(at), {len(curve.x) - 2})",
             "value = CURVE[k] + (at - k) * (CURVE[k + 1] - CURVE[k])"]  # fmt: skip
    factor = {"": "", "T": " * abs(T)", "u": " * abs(u)" if law.place == "gear" else " * u", "d": " * d",
              "w": " * w" if curve.over == "t" else " * tanh(w / 2e-3)"}[curve.factor]  # fmt: skip
    if law.place == "ft" and curve.factor == "T":
        factor = " * T"
    return "\n".join(
        f"    {line}" for line in [*lines, f"torque = p[0] * value{factor}", *_addition_lines(law, 0)]
    )


def states_of(law: Law) -> int:
    """Return how many states the file's function keeps."""
    sizes = {"": 0, "lag": 1, "heat": 1, "delay": RING + 1, "dahl": 2, "play": 2, "ring": 2}
    return int(law.is_friction) + sum(sizes[p.term.memory] for p in law.parts) + 2 * (law.place == "encoder")


def _read(law: Law, letter: str) -> str:
    if law.place in ("ft", "encoder"):
        return _AT_SENSOR.get(letter, f"s[{READS.get(letter, '')}]")
    if letter == "h":  # one end is clamped: it stays at zero, and no torque moves it
        return "s[HOUSING_ANGLE] + s[DISTAL_ANGLE]"
    if law.place in ("command", "motor"):
        return _AT_COMMAND.get(letter, f"s[{READS.get(letter, '')}]")
    return f"s[{READS[letter]}]"


def is_limited(law: Law, letter: str) -> bool:
    """Return whether a law keeps its value beyond the range of a variable: no wave and no gain does."""
    return letter not in ("theta", "q") and not (
        letter in ("T", "u") and law.place in ("ft", "command", "motor")
    )


def _variables(law: Law) -> list[str]:
    lines = []
    for letter in READS:
        if letter in letters_of(law):
            limit = law.ranges[letter] * FARTHER
            value = _read(law, letter)
            within = f"min(max({value}, -{limit:.6g}), {limit:.6g})"
            lines.append(f"{letter} = {within if is_limited(law, letter) else value}")
    time = time_letters(law)
    if "t" in time:
        lines.append("t = s[TIME]")
    if "share" in time:
        lines.append("share = s[TIME] / s[DURATION]")
    return lines


def _addition_lines(law: Law, state: int) -> list[str]:
    if law.place != "encoder":
        return [_ADDS[law.place]]
    rate = f"(torque - x[{state}]) / s[STEP] if x[{state + 1}] == 1.0 else 0.0"
    return ["s[POSITION] += torque", f"s[VELOCITY] += {rate}",
            f"x[{state}], x[{state + 1}] = torque, 1.0"]  # fmt: skip


def _with_letter(expression: str, letter: str, replaced: str) -> str:
    return re.sub(rf"\b{letter}\b", replaced, expression)


def _memory(part: FittedTerm, name: str, shape: str, state: int) -> tuple[list[str], int]:
    """Return the lines that keep a memory in the states from `state` on, and the next free one."""
    of, kind = part.term.remembers, part.term.memory
    if kind in ("lag", "heat"):
        value = f"{of} * {of}" if kind == "heat" else of
        return [
            f"x[{state}] = lagged(x[{state}], {value}, s[STEP], {shape})",
            f"{name} = x[{state}]",
        ], state + 1
    if kind == "ring":
        zeta = part.term.constant
        rung = f"{name} = rung(x, {state}, {of}, s[STEP], {shape}, {zeta:g})"
        if part.term.place == "spring":  # called twice a step; only the second may change a state
            return [f"{name} = x[{state}]", "if s[COMMIT] == 1.0:", f"    {rung}"], state + 2
        return [rung], state + 2
    if kind == "delay":
        return [f"{name} = from_ring(x, {state}, {of}, {shape} / s[STEP])"], state + RING + 1
    made = (
        f"bent(x[{state}], {of} - x[{state + 1}], {shape})"
        if kind == "dahl"
        else f"played(x[{state}], {of}, {shape})"
    )
    keep = [f"{name} = {made}"]
    commit = "if s[COMMIT] == 1.0:" if part.term.place == "spring" else "if True:"
    keep += [commit, f"    x[{state}], x[{state + 1}] = {name}, {of}"]
    if commit == "if True:":
        keep = [keep[0], keep[2].strip()]
    return keep, state + 2
