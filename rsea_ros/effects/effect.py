"""The effect: a small change to one named signal of the nominal actuator.

An effect is one file of this folder with one constant `EFFECT`. Its function is compiled on its own and
called through its address, so the step is compiled only once and a run pays only for its active effects.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

from numba import types

from rsea_ros.compiler import cfunc
from rsea_ros.documents.units import with_unit
from rsea_ros.documents.wording import quote
from rsea_ros.effects.guess import Guess, Guesses
from rsea_ros.effects.parameter import PHASE as PHASE, Parameter as Parameter, Scale
from rsea_ros.effects.signal_table import Port, sensor_of
from rsea_ros.errors import ParameterError

_POINTER = types.CPointer(types.float64)  # type: ignore[no-untyped-call]
_SIGNATURE = types.void(_POINTER, _POINTER, _POINTER)

_ROUNDING = 1e-9
"""Of the wider bound: what a fitted value may lie beyond it through logarithms and decimal digits."""
Parity = Literal["odd", "even", "neither"]
Tag = Literal["delay", "late", "lag", "play", "mode", "friction", "limit"]
"""What others have to know of an effect's kind.

delay, late: shifts the command, or a sensor, by its main parameter, s, and does nothing else. play: its
main parameter is a gap, rad. mode: adds a resonance, near which derivatives do not reach far. friction: a
torque of the gear train that depends on how it moves. limit: its main parameter is the largest torque, N m.
"""
Response = Callable[[Sequence[float], Any], Any]
"""Parameters in order and s = 2 pi i f, shape (n,), to the factor on the effect's signal, shape (n,)."""
Parameters = Sequence[float]
"""Of an effect, in order, as the laws of compensation have them. A controller calls these in Python: one that
compiles in its first cycles is late."""


@dataclass(frozen=True)
class AgainstMotion:
    """A torque against the motion. mean: speeds of the gear output at both ends of a hold, rad/s, to N m.

    Positive against a positive speed: torque that the motor has to add.
    """

    mean: Callable[[Parameters, float, float], float]


@dataclass(frozen=True)
class OfRotorAngle:
    """A torque of the rotor's angle. mean: angles of the rotor at both ends of a hold, rad, to N m.

    Positive where it drives forward: torque that the motor has to subtract.
    """

    mean: Callable[[Parameters, float, float], float]


@dataclass(frozen=True)
class Gap:
    """A play that the motor has to cross where the torque changes sign. width: the whole gap, rad."""

    width: Callable[[Parameters], float]


Compensable = AgainstMotion | OfRotorAngle | Gap


@dataclass(frozen=True)
class Claims:
    """The action of the effect, in a form that a test can check in simulation.

    channel: where it shows most. parity: odd when turning the command's sign turns the sign of the
    change, even when it keeps it. amplitude_exponent: the change grows with the command's amplitude to
    this power (None: no power law). passive: it can only take energy from the mechanics.
    """

    channel: str
    parity: Parity
    amplitude_exponent: float | None
    passive: bool = False
    confusable_with: tuple[str, ...] = ()


@dataclass(frozen=True)
class Effect:
    """An effect of the catalogue. The docstring of its file is its description.

    function: compiled `f(s, p, x)` with the signal table s, the parameters p in order, its own states x.
    structure: instead of a function, a change to the rig: `f(rig, parameters) -> rig`.
    main: the parameter that gives the size of the effect.
    is_searched: a diagnosis tries it; otherwise it acts only where a rig states it.
    reads: the signals among FIRST_READ … LAST_READ that the function looks at; at GEAR and SPRING only.
    guesses: initial guesses from a residual; without it, `default_guesses`.
    tags: its kinds. compensation: the torque that a controller may add against it, by the same law.
    response: its linear frequency response on its signal (at a sensor, on ft), for a controller's margins.
    part: of the bench, if not the one of its port.
    idle: the parameters that do nothing on a rig: `f(rig) -> names`.
    inspect: what a mechanic looks at where this is named.
    equation: by default the first indented lines of the docstring of its file, where it is written once.
    """

    name: str
    port: Port
    parameters: tuple[Parameter, ...]
    claims: Claims
    function: Any = None
    structure: Callable[[Any, Mapping[str, float]], Any] | None = None
    states: int = 0
    reads: tuple[int, ...] = ()
    order: int = 0
    is_searched: bool = True
    about: str = ""
    inspect: str = ""
    equation: str = ""
    guesses: Guesses | None = None
    tags: tuple[Tag, ...] = ()
    compensation: Compensable | None = None
    response: Response | None = None
    part: str = ""
    idle: Callable[[Any], tuple[str, ...]] | None = None

    def __post_init__(self) -> None:
        if self.reads and self.port in (Port.COMMAND, Port.MOTOR, Port.SENSOR):
            known = "OUTPUT_ANGLE and OUTPUT_VELOCITY at the end of the last step, without reads"
            raise ParameterError(
                f"effect {self.name}: reads at port {self.port.name}, expected port GEAR or SPRING ({known})"
            )
        if not self.equation:
            object.__setattr__(self, "equation", equation_of(self.docstring))

    @property
    def docstring(self) -> str:
        """Return the docstring of the file of the effect's function."""
        python = self.structure or getattr(self.function, "__wrapped__", None)
        return getattr(python, "__globals__", {}).get("__doc__") or ""

    @property
    def main(self) -> Parameter:
        """Return the first parameter, which gives the size of the effect."""
        return self.parameters[0]

    @property
    def sensor(self) -> str:
        """Return the channel of the sensor in which an effect at a sensor acts: `ft` or `position`."""
        return sensor_of(self.claims.channel)

    @property
    def null(self) -> dict[str, float]:
        """Return the parameters at which the effect vanishes."""
        return {p.name: p.null for p in self.parameters}

    @property
    def typical(self) -> dict[str, float]:
        """Return parameters of a size that a bench may well have."""
        return {p.name: p.typical for p in self.parameters}

    def at(self, scale: Scale) -> Effect:
        """Return the effect with bounds, sizes and starts that suit a machine."""
        return replace(self, parameters=tuple(p.at(scale) for p in self.parameters))

    def widen(self, parameters: Mapping[str, float]) -> Effect:
        """Return the effect with bounds that hold the parameters which a rig states."""
        values = self.complete(parameters)
        return replace(self, parameters=tuple(p.widen(values[p.name]) for p in self.parameters))

    @property
    def default_guesses(self) -> list[Guess]:
        """Return the typical parameters, then beside them each one's other starts and its other sign.

        An angle (rad) has its signs among its starts.
        """
        guesses = [dict(self.typical)]
        for p in self.parameters:
            has_both_signs = p.low < 0.0 and not p.logarithmic and p.unit != "rad"
            others = [*p.starts, *([-p.typical] if has_both_signs else [])]
            guesses += [{**self.typical, p.name: value} for value in others]
        return guesses

    def vector(self, parameters: Mapping[str, float]) -> tuple[float, ...]:
        """Return parameters in order. Raises ParameterError for a missing, unknown or non-finite one."""
        names = [p.name for p in self.parameters]
        expected = f"expected {', '.join(names)}"
        for name in parameters:
            if name not in names:
                raise ParameterError(f"effect {self.name}: unknown parameter {quote(name)}, {expected}")
        full = self.complete(parameters)
        for name in names:
            if name not in full:
                raise ParameterError(
                    f"effect {self.name}: parameter {name!r} is missing, expected {', '.join(names)}"
                )
            if math.isnan(full[name]):
                raise ParameterError(f"effect {self.name}: {name} = nan, expected a number")
        return tuple(float(full[name]) for name in names)

    def check(self, parameters: Mapping[str, float]) -> None:
        """Raise ParameterError as `vector` does, and for a value out of its bounds; null always is one."""
        values = self.vector(parameters)
        for p, value in zip(self.parameters, values, strict=True):
            low, high = p.possible
            margin = _ROUNDING * max(abs(low), abs(high))
            if not (low - margin <= value <= high + margin or value == p.null):
                stated = with_unit(f"{p.name} = {value:g}", p.unit)
                raise ParameterError(f"effect {self.name}: {stated}, expected {p.bounds}")

    def complete(self, parameters: Mapping[str, float]) -> dict[str, float]:
        """Return parameters with the optional ones that were left out at their null value."""
        return {p.name: p.null for p in self.parameters if p.optional} | dict(parameters)


def compiled(function: Callable[[Any, Any, Any], None]) -> Any:
    """Compile an effect's function to an address that the step can call; cached on disk."""
    return cfunc(_SIGNATURE, cache=True, error_model="numpy")(function)


def equation_of(docstring: str) -> str:
    """Return the first indented lines of a docstring as one line; empty without any."""
    begin, end = _place(lines := docstring.splitlines())
    return " ".join(line.strip() for line in lines[begin:end])


def without_equation(docstring: str) -> str:
    """Return a docstring without its first indented lines, and the empty line after them."""
    begin, end = _place(lines := docstring.strip().splitlines())
    return "\n".join([*lines[:begin], *lines[end + 1 :]]).strip()


def _place(lines: list[str]) -> tuple[int, int]:
    """Return the first and the one after the last of the first indented lines; both the end without any."""
    indented = [line.startswith("    ") and bool(line.strip()) for line in lines]
    begin = indented.index(True) if True in indented else len(lines)
    rest = indented[begin:]
    return begin, begin + (rest.index(False) if False in rest else len(rest))
