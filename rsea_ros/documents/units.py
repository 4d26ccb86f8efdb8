"""Units as people write them: `Nm`, `N*m`, `N·m` and `N m` are one, `kg m^2`, `kgm2` and `kg*m²` too."""

import re

STANDARD_GRAVITY = 9.80665
"""m/s^2, by definition (3rd CGPM, 1901)."""

_SEPARATOR = re.compile(r"[\s·⋅∙*.]+|-(?=[A-Za-z])")
_RAISED = str.maketrans("²³µ", "23μ")
_SAME = {
    "°": "deg",
    "°/s": "deg/s",
    "μs": "us",
    "μm": "um",
    "rev/min": "rpm",
    "N m/(rad/s)": "N m s/rad",
    "Nm/(rad/s)": "N m s/rad",
    "-": "1",
    "1/1": "1",
}

_ALONG_A_LINE = {
    "rad": "m",
    "rad/s": "m/s",
    "N m": "N",
    "N m/rad": "N/m",
    "N m s/rad": "N s/m",
    "kg m^2": "kg",
    "1/rad": "1/m",
    "1/rad^2": "1/m^2",
}


def in_motion(unit: str, *, linear: bool) -> str:
    """Return the unit of a linear machine that corresponds to a unit of a rotary one."""
    return _ALONG_A_LINE.get(unit, unit) if linear else unit


def plain(unit: str) -> str:
    """Return a unit with its signs, `kg m^2` as `kg·m²`, `deg` as `°`; the unit of a bare number is empty."""
    return "" if unit == "1" else "°" if unit == "deg" else unit.replace("^2", "²").replace(" ", "·")


def with_unit(number: str, unit: str) -> str:
    """Return a number with its unit as people write it, `3.9 N·m·s/rad`; a bare number without one."""
    return f"{number} {plain(unit)}".rstrip()


def same_unit(text: object, unit: str) -> bool:
    """Return whether a text means a unit, which is written as in `N m s/rad`.

    Blanks between the symbols may be left out, but not put into a symbol: `m s` is no millisecond.
    """
    words, wanted = _words(str(text).strip()), _words(unit)
    if words == wanted:
        return True
    return " " in wanted and words.replace(" ", "") == wanted.replace(" ", "")


def _words(text: str) -> str:
    """Return the symbols with a blank between factors, exponents without a sign of power."""
    plain = text.replace("**", "^").translate(_RAISED)
    plain = " ".join(_SEPARATOR.sub(" ", plain).split()) if plain != "-" else plain
    plain = re.sub(r" ?/ ?", "/", plain.replace("^", ""))
    return _SAME.get(plain, plain)
