"""The effect: a small change to one named signal of the nominal actuator.

An effect is one file of this folder with one constant `EFFECT`. Its function is compiled on its own and
called through its address, so the step is compiled once for all and a run pays only for what is on.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Literal, Protocol

from numba import types

from rsea_ros.compiler import cfunc
from rsea_ros.effects.guess import Guess, Guesses
from rsea_ros.effects.signal_table import Port
from rsea_ros.errors import ParameterError
from rsea_ros.wording import shown

_POINTER = types.CPointer(types.float64)  # type: ignore[no-untyped-call]
_SIGNATURE = types.void(_POINTER, _POINTER, _POINTER)

_ROUNDING = 1e-9
"""Of the wider bound: what a fitted value may lie beyond it through logarithms and decimal digits."""
_SIZED = {"N m", "N m/rad", "N m s/rad", "rad/s"}
_OTHER_MACHINES = 1e3
"""How many times larger or smaller a machine may be than those that the bounds of the fits suit."""
Parity = Literal["odd", "even", "neither"]


class RigLike(Protocol):
    """What a structural effect needs of a rig (the model's Rig has it; effects do not import the model)."""

    def __getitem__(self, name: str) -> float: ...
    def with_values(self, values: Mapping[str, float]) -> Any: ...


@dataclass(frozen=True)
class Parameter:
    """One parameter of an effect, SI.

    null: the value at which the effect vanishes. low, high: bounds of a fit. typical: a size that a bench
    may well have. starts: where fits begin besides `typical`, for problems with several minima.
    optional: may be left out; then it is `null`.
    shapes: counts in the size of the law although it may be left out: it makes another law of it.
    per_record: another in every record, such as the phase that the mains had when it began.
    """

    name: str
    unit: str
    null: float
    low: float
    high: float
    typical: float
    starts: tuple[float, ...] = ()
    logarithmic: bool = False
    optional: bool = False
    shapes: bool = False
    per_record: bool = False

    @property
    def is_counted(self) -> bool:
        """Whether a law with this parameter is larger than one without."""
        return self.shapes or not self.optional

    @property
    def possible(self) -> tuple[float, float]:
        """Return what a person may state: the bounds of a fit, wider where they go with a machine's size."""
        width = _OTHER_MACHINES if self.unit in _SIZED else 1.0
        return self.low * width if self.low < 0.0 else self.low / width, self.high * width

    @property
    def bounds(self) -> str:
        """Return the possible values for people."""
        low, high = self.possible
        return f"{low:g} to {high:g} {self.unit}"


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
    main: the parameter that says how large the effect is.
    is_searched: a diagnosis tries it unasked; one that is not acts only where a rig states it.
    reads: the signals among FIRST_READ … LAST_READ that the function looks at.
    guesses: where fits begin by what a residual shows; without it, at `default_guesses`.
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
    equation: str = ""
    guesses: Guesses | None = None

    @property
    def main(self) -> Parameter:
        """Return the first parameter, the one that says how large the effect is."""
        return self.parameters[0]

    @property
    def null(self) -> dict[str, float]:
        """Return the parameters at which the effect vanishes."""
        return {p.name: p.null for p in self.parameters}

    @property
    def typical(self) -> dict[str, float]:
        """Return parameters of a size that a bench may well have."""
        return {p.name: p.typical for p in self.parameters}

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
                raise ParameterError(f"effect {self.name}: unknown parameter {shown(name)}, {expected}")
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
                raise ParameterError(
                    f"effect {self.name}: {p.name} = {value:g} {p.unit}, expected {p.bounds}"
                )

    def complete(self, parameters: Mapping[str, float]) -> dict[str, float]:
        """Return parameters with the optional ones that were left out at their null value."""
        return {p.name: p.null for p in self.parameters if p.optional} | dict(parameters)


def compiled(function: Callable[[Any, Any, Any], None]) -> Any:
    """Compile an effect's function to an address that the step can call; cached on disk."""
    return cfunc(_SIGNATURE, cache=True, error_model="numpy")(function)
