"""A law as an effect file: its equation in the docstring, parameters with units, measured claims, provenance.

The file is a plugin like any other (RSEA_EFFECTS): readable, editable, and complete but for the catalogue's
helpers.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from rsea_ros.documents.wording import in_docstring
from rsea_ros.effects.effect import Claims
from rsea_ros.laws.body import FARTHER, body_of, curve_body, is_limited, states_of
from rsea_ros.laws.law import Law
from rsea_ros.laws.law_text import about_of, equation_of
from rsea_ros.laws.variable_places import READS, letters_of, words_of

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


def source_of(law: Law, claims: Claims, provenance: LawProvenance) -> str:
    """Return the text of the effect file."""
    header = _docstring(law, provenance)
    body = curve_body(law) if law.curve is not None else body_of(law)
    signature = 'def apply(s, p, x):  # type: ignore[no-untyped-def]\n    """Add the law."""'
    function = f"@compiled\n{signature}\n{body}\n"
    return f"{header}\n{_imports(law, body)}\n{_tables(law)}\n{function}\n\n{_effect(law, claims)}"


def _docstring(law: Law, provenance: LawProvenance) -> str:
    kind = "A learnt law, no cause: a curve through data" if law.is_learnt else "A law that was found in data"
    seen = "; ".join(f"{_LETTERS[n]}: up to {v:.3g}" for n, v in law.ranges.items() if n in letters_of(law))
    bags = "\n".join(f"    {in_docstring(name)}  sha256 {digest}" for name, digest in provenance.bags.items())
    kept = "its last value" if law.is_learnt else f"the value at {FARTHER:g} times that range"
    limited = law.is_learnt or any(is_limited(law, n) for n in letters_of(law))
    beyond = f" Beyond it the law keeps {kept}." if limited else ""
    reach = [f"Seen in the data: {seen}.{beyond}"] if seen else []
    lines = [
        f'"""{kind}: {"angle error" if law.place == "encoder" else "torque"} by {law.regressor}.',
        "", f"    {equation_of(law)}", "",
        *reach,
        provenance.gain, f"Source: rsea law {provenance.version} on {provenance.date}, from", bags, '"""',
    ]  # fmt: skip
    return "\n".join(lines) + "\n"


def _tables(law: Law) -> str:
    if law.curve is None:
        return ""
    values = ", ".join(f"{v:.6g}" for v in law.curve.y)
    return (f"FIRST, SPACING = {law.curve.x[0]:.9g}, {law.curve.x[1] - law.curve.x[0]:.9g}\n"
            f"CURVE = np.array([{values}])\n\n")  # fmt: skip


def _imports(law: Law, body: str) -> str:
    words = words_of(body)
    maths = sorted(words & {"sin", "cos", "tanh", "exp", "pi"})
    table = sorted(set(_table_names()) & words | {"Port"})
    helpers = sorted(words & {"lagged", "bent", "played", "from_ring", "rung"})
    lines = [f"from math import {', '.join(maths)}\n"] if maths else []
    lines += ["import numpy as np\n"] if law.curve is not None else []
    friction = "PRESLIDING, mean_friction" if law.is_friction else ""
    lines += [f"from rsea_ros.effects._friction import {friction}"] if friction else []
    lines += ["from rsea_ros.effects.effect import Claims, Effect, Parameter, compiled",
              f"from rsea_ros.effects.signal_table import {', '.join(table)}"]  # fmt: skip
    lines += [f"from rsea_ros.laws.memory import {', '.join(helpers)}"] if helpers else []
    return "\n".join(lines) + "\n"


def _table_names() -> list[str]:
    from rsea_ros.effects import signal_table

    return [n for n in vars(signal_table) if n.isupper()]


def _effect(law: Law, claims: Claims) -> str:
    port = {"gear": "GEAR", "load": "GEAR", "spring": "SPRING", "motor": "MOTOR", "command": "COMMAND"}.get(
        law.place, "SENSOR"
    )
    rows = "".join(f"        {row},\n" for row in _parameter_rows(law))
    letters = letters_of(law) - {"u"} if law.place in ("gear", "load", "spring") else set()
    reads = [READS[n] for n in READS if n in letters] + ["DISTAL_ANGLE"] * ("h" in letters)
    reading = f"    reads=({', '.join(reads)},),\n" if reads else ""
    exponent = claims.amplitude_exponent
    states = states_of(law)
    return (
        f'EFFECT = Effect(\n    name="{law.name}",\n    port=Port.{port},\n    parameters=(\n{rows}    ),\n'
        f'    claims=Claims("{claims.channel}", "{claims.parity}", amplitude_exponent={exponent}, '
        f"passive={claims.passive}),\n    function=apply,\n"
        + (f"    states={states},\n" if states else "") + reading
        + f'    about="{about_of(law)}",\n    equation="{equation_of(law)}",\n)\n'
    )  # fmt: skip


def _parameter_rows(law: Law) -> list[str]:
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
