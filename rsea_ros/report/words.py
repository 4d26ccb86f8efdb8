"""Names, units and numbers for readers, and text in lines that fit a terminal."""

import math
import textwrap

from rsea_ros.documents.units import plain

CHANNELS = {
    "command": "commanded motor torque", "motor_torque": "motor torque", "position": "position",
    "velocity": "velocity", "ft": "F/T torque", "deflection": "spring deflection",
    "reference": "reference position",
    "reference_velocity": "reference velocity",
}  # fmt: skip

PARAMETERS = {
    "rotor.reflected_inertia": "Rotor inertia, reflected",
    "rotor.reflected_damping": "Rotor damping, reflected", "gear.ratio": "Gear ratio",
    "gear.stiffness": "Gear stiffness", "gear.damping": "Gear damping",
    "chassis.inertia": "Spring chassis inertia", "spring.stiffness": "Spring stiffness",
    "spring.damping": "Spring damping",
}  # fmt: skip

SYMBOLS = {
    "rotor.reflected_inertia": "J_m", "rotor.reflected_damping": "b_m", "gear.ratio": "N",
    "chassis.inertia": "J_sc", "spring.stiffness": "K_s", "spring.damping": "b_s",
}  # fmt: skip
"""As in the paper; what stands after _ is an index."""

_PROPER = {"coulomb": "Coulomb", "lugre": "LuGre", "stribeck": "Stribeck", "ft": "F/T"}
unit = plain

_PIECES = {"housing_end": "Housing", "spring_end": "Spring end", "clock": "Clock"}
_PREFIXES = ((1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n"))


def train(name: str) -> str:
    """Return the plain name of a gear train, `harmonic_flexspline_held` as `harmonic, flexspline held`."""
    kind, _, held = name.partition("_")
    return f"{kind}, {held.replace('_', ' ')}" if held else kind


def parameter(name: str) -> str:
    """Return the plain name of a parameter, `housing_end.inertia` as `Housing: inertia`."""
    group, _, key = name.partition(".")
    plain = key.replace("_", " ")
    return PARAMETERS.get(name, f"{_PIECES.get(group, group.replace('_', ' ').capitalize())}: {plain}")


def effect(name: str) -> str:
    """Return the plain name of an effect for use within a sentence, `Coulomb friction`."""
    return " ".join(_PROPER.get(word, word) for word in name.split("_"))


def fault(kind: str) -> str:
    """Return the plain name of a kind of fault of the data."""
    return "NaN" if kind == "nan" else kind.replace("_", " ")


def channel(name: str) -> str:
    """Return the plain name of a channel."""
    return CHANNELS.get(name, name)


def sentence(text: str) -> str:
    """Return text that begins with a capital."""
    return text[:1].upper() + text[1:]


def minus(text: str) -> str:
    """Return a number's text with a minus sign instead of a hyphen."""
    return text.replace("-", "−")


def signed_text(value: float, digits: int) -> str:
    """Return a value with its sign and a number of decimal places."""
    return minus(f"{value:+.{digits}f}")


def hertz(value: float) -> str:
    """Return a frequency, or that it has no limit."""
    return "no limit" if math.isinf(value) else f"{value:.1f}"


def number(value: float, digits: int = 3) -> str:
    """Return a value with a number of significant digits, without an exponent if possible."""
    if not math.isfinite(value):
        return "∞" if value > 0.0 else "−∞" if value < 0.0 else "–"
    if value == 0.0:
        return "0"
    exponent = math.floor(math.log10(abs(value)))
    if -4 <= exponent < 6:
        return minus(f"{value:.{max(0, digits - 1 - exponent)}f}")
    return minus(f"{value:.{digits - 1}e}")


def probability(value: float) -> str:
    """Return a probability with three digits, which never rounds to certainty."""
    return "> 0.999" if value >= 0.9995 else f"{value:.3f}" if value >= 5e-4 else "< 0.001"


def quantity(value: float, of: str, digits: int = 3) -> str:
    """Return a value with its unit, small ones with a prefix: 6.1e-6 rad as `6.10 µrad`."""
    factor, prefixed = unit_factor(value, of)
    return f"{number(value * factor, digits)} {prefixed}".strip()


def unit_factor(value: float, of: str) -> tuple[float, str]:
    """Return the factor that makes a value readable, and its unit then: 6.1e-6 rad gives 1e6, `µrad`."""
    simple = of and " " not in of.split("/")[0] and not of.startswith("1")
    if not simple or value == 0.0 or not math.isfinite(value) or abs(value) >= 0.1:
        return 1.0, unit(of)
    factor, prefix = next((p for p in _PREFIXES if abs(value) >= 0.999 * p[0]), _PREFIXES[-1])
    return 1.0 / factor, f"{prefix}{unit(of)}"


def times(ratio: float) -> str:
    """Return a ratio, such as of a residual to its noise, rounded so that it stays on its side of a limit."""
    return f"{ratio:.2f}" if ratio < 2.0 else f"{ratio:.2g}" if ratio < 100.0 else f"{ratio:.0f}"


def span(low: float, high: float, of: str) -> str:
    """Return a range with its unit, both ends to two digits of its width: `0 to 0.041 N·m`."""
    factor, prefixed = unit_factor(max(abs(low), abs(high)), of)
    low, high = low * factor, high * factor
    width = high - low
    if not (math.isfinite(width) and width > 0.0):
        return f"{number(low)} to {number(high)} {prefixed}".rstrip()
    decimals = 1 - math.floor(math.log10(width))
    ends = (round(end, decimals) for end in (low, high))
    low_text, high_text = (minus(f"{end:.{max(0, decimals)}f}") if end else "0" for end in ends)
    return f"{low_text} to {high_text} {prefixed}".rstrip()


def measured(value: float, low: float, high: float, of: str) -> tuple[str, str, str]:
    """Return value, doubt and unit: ("4.0045", " ± 0.0029", "mrad"), or lopsided " −0.1/+1.4"."""
    factor, unit = unit_factor(value, of)
    return *with_doubt(value * factor, low * factor, high * factor), unit


def measured_text(value: float, low: float, high: float, of: str) -> str:
    """Return the same in one text, `4.0045 ± 0.0029 mrad`."""
    text, doubt, unit = measured(value, low, high, of)
    return f"{text}{doubt} {unit}".rstrip()


LOPSIDED = 1.5
"""Ratio of the sides of an interval, from which each is shown instead of ± their mean."""


def with_doubt(value: float, low: float, high: float) -> tuple[str, str]:
    """Return value and doubt as text: ("4.000", " ± 0.020"), or lopsided ("4.000", " −0.010/+0.14")."""
    shown, half = with_interval(value, low, high)
    below, above = value - low, high - value
    if not half or max(below, above) <= LOPSIDED * min(below, above):
        return shown, f" ± {half}" if half else ""
    nearer = min(side for side in (below, above) if side > 0.0)
    exact = with_interval(value, value - nearer, value + nearer)[0]
    return exact, f" −{number(below, 2).lstrip('−')}/+{number(above, 2)}"


def with_interval(value: float, low: float, high: float) -> tuple[str, str]:
    """Return value and half-width of its interval as text, to two significant digits of the half-width."""
    half = 0.5 * (high - low)
    if not (math.isfinite(half) and half > 0.0):
        return number(value, 4), ""
    decimals = 1 - math.floor(math.log10(half))
    if not -3 < decimals < 9:
        return number(value, 6), number(half, 2)
    shown = max(0, decimals)
    return minus(f"{round(value, decimals):.{shown}f}"), f"{round(half, decimals):.{shown}f}"


WIDTH = 100
"""Columns of a line at most, where nothing says how wide the terminal is."""
LABEL = 12
"""Columns of the label that a row begins with."""


def wrap(text: str, width: int = WIDTH, indent: int = 0) -> str:
    """Return text in lines of at most `width` columns, all but the first indented.

    A word that is longer, such as a path, stays whole.
    """
    lines = textwrap.wrap(
        text, width, subsequent_indent=" " * indent, break_long_words=False, break_on_hyphens=False
    )
    return "\n".join(lines)


def row(label: str, text: str, width: int = WIDTH) -> str:
    """Return a label and its text, which continues below itself."""
    return wrap(f"{label:<{LABEL}}{text}", width, LABEL)


def command_row(label: str, text: str, command: str, width: int = WIDTH) -> str:
    """Return a label, its text, and a command, which is never broken: it is to be copied."""
    line = f"{label:<{LABEL}}{text} {command}"
    return line if len(line) <= width else f"{row(label, text, width)}\n{' ' * LABEL}{command}"
