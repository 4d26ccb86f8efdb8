"""A law in words and as an equation in plain text."""

from __future__ import annotations

from rsea_ros.laws.law import Law

_SYMBOLS = {"w": "ω", "q": "q", "theta": "θ", "d": "d", "T": "T_s", "u": "u", "t": "t", "h": "φ"}


def equation_of(law: Law) -> str:
    """Return the equation with the names of the parameters, in plain text."""
    left = {
        "encoder": "position error",
        "ft": "T_ft error",
        "motor": "T_m added",
        "command": "T_m added",
    }.get(law.place, "T")
    if law.curve is not None:
        factor = {"": "", "T": "·|T_s|", "u": "·u", "w": "·ω", "d": "·d"}[law.curve.factor]
        return f"{left} = size · f({_SYMBOLS[law.curve.over]}){factor}, f learnt from data"
    terms = []
    for part, (c, s) in zip(law.parts, law.names, strict=True):
        text = part.term.equation.format(a=s) if s else part.term.equation
        if s and s not in text:
            text += f" with {s}"
        terms.append(_signed_text(c, text, minus=part.term.friction))
    tail = ", smooth below creep_velocity" if law.is_friction else ""
    return f"{left} = {' + '.join(terms).replace('+ -', '- ')}{tail}"


def _signed_text(coefficient: str, text: str, *, minus: bool) -> str:
    bare = text.removeprefix("-")
    sign = "-" if minus or bare != text else ""
    return f"{sign}{coefficient}" if bare == "1" else f"{sign}{coefficient} · {bare}"


def about_of(law: Law) -> str:
    """Return the meaning of the law in a few words."""
    kind = "learnt law" if law.is_learnt else "law found in data"
    return f"{kind}: {'angle error' if law.place == 'encoder' else 'torque'} by {law.regressor}"
