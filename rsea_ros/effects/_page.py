"""An effect for its reader: meaning, equation, parameters and source."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

from rsea_ros.documents.units import plain
from rsea_ros.effects.effect import Effect, Parameter, without_equation
from rsea_ros.effects.parameter import powers_of


@dataclass(frozen=True)
class EffectPage:
    """An effect of the catalogue, shown as text, or as a table in a notebook."""

    effect: Effect

    @property
    def name(self) -> str:
        """The name in rigs, results and `rsea.effects`."""
        return self.effect.name

    @property
    def about(self) -> str:
        """The meaning in a few words."""
        return self.effect.about

    @property
    def equation(self) -> str:
        """The equation in plain text."""
        return self.effect.equation

    @property
    def parameters(self) -> dict[str, Parameter]:
        """Parameters by name, with unit, bounds, typical size and the value at which the effect vanishes."""
        return {p.name: p for p in self.effect.parameters}

    @property
    def description(self) -> str:
        """The docstring of the effect's file without its equation: meaning and source."""
        return without_equation(self.effect.docstring)

    def __repr__(self) -> str:
        """Return name, meaning, equation and parameters as text."""
        rows = [
            f"  {p.name} ({plain(p.unit) or 1}): typical {p.typical:g}, vanishes at {p.null:g}, "
            f"fitted within {p.low:g} to {p.high:g}" + _after(", growing with ", self.grows_with(p))
            + f": {p.reason}"
            for p in self.effect.parameters
        ]
        return "\n".join([f"{self.name}: {self.effect.about}", f"  {self.equation}", *rows])

    @staticmethod
    def grows_with(parameter: Parameter) -> str:
        """Return with which numbers of the machine bounds and sizes grow, as a fraction; empty for none."""
        powers = () if parameter.is_fixed else powers_of(parameter.unit)
        over, under = (
            " ".join(name if abs(k) == 1 else f"{name}^{abs(k)}" for name, k in powers if k * side > 0)
            for side in (1, -1)
        )
        return (over or "1") + _after(" / ", under) if powers else ""

    def _repr_html_(self) -> str:
        head = "<tr><th>parameter</th><th>unit</th><th>typical</th><th>vanishes at</th><th>bounds</th>"
        head += "<th>grows with</th><th>why</th></tr>"
        rows = "".join(
            f"<tr><td>{escape(p.name)}</td><td>{escape(plain(p.unit) or '1')}</td>"
            f"<td>{p.typical:g}</td><td>{p.null:g}</td>"
            f"<td>{p.low:g} to {p.high:g}</td><td>{self.grows_with(p)}</td>"
            f"<td>{escape(p.reason)}</td></tr>"
            for p in self.effect.parameters
        )
        description = escape(self.description)
        equation = f"<p><code>{escape(self.equation)}</code></p>"
        return f"<h4>{escape(self.name)}</h4>{equation}<table>{head}{rows}</table><pre>{description}</pre>"


def catalogue_table(pages: Sequence[EffectPage]) -> str:
    """Return an HTML table of effects: name, meaning, equation."""
    head = "<tr><th>effect</th><th>what it is</th><th>equation</th></tr>"
    rows = "".join(
        f"<tr><td><b>{escape(p.name)}</b></td><td>{escape(p.about)}</td><td>{escape(p.equation)}</td></tr>"
        for p in pages
    )
    return f"<table>{head}{rows}</table>"


def _after(joint: str, text: str) -> str:
    return joint + text if text else ""
