"""The catalogue: every file of this folder that has an `EFFECT`, files that a user adds; its pages."""

import importlib
import os
import pkgutil
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from html import escape
from pathlib import Path
from types import MappingProxyType

from rsea_ros.documents.units import plain
from rsea_ros.documents.wording import did_you_mean, quote
from rsea_ros.effects.effect import Effect, Parameter, without_equation
from rsea_ros.effects.parameter import POWERS
from rsea_ros.errors import ParameterError
from rsea_ros.plugins import plugin_constant, plugin_files

_NOT_EFFECTS = {"catalogue", "effect", "guess", "parameter", "signal_table"}
EXTRA_PATH = "RSEA_EFFECTS"
"""Environment variable: effect files or folders of them beside the package's own, separated like PATH."""

_LENT: dict[str, Effect] = {}


@lru_cache(maxsize=8)
def _catalogue(extra: tuple[str, ...]) -> Mapping[str, Effect]:
    modules = [importlib.import_module(f"rsea_ros.effects.{name}") for name in sorted(_own_names())]
    effects = [m.EFFECT for m in modules]
    effects += [plugin_constant(EXTRA_PATH, path, "EFFECT", Effect) for path in extra]
    return MappingProxyType({e.name: e for e in effects})


def catalogue() -> Mapping[str, Effect]:
    """Return every effect by name, those of RSEA_EFFECTS included."""
    known = _catalogue(tuple(str(p) for p in plugin_files(os.environ.get(EXTRA_PATH, ""))))
    return MappingProxyType({**known, **_LENT}) if _LENT else known


@contextmanager
def lend(*effects: Effect) -> Iterator[None]:
    """Add effects without a file in the catalogue for the duration of a block, such as a law just learned."""
    before = dict(_LENT)
    _LENT.update({e.name: e for e in effects})
    try:
        yield
    finally:
        _LENT.clear()
        _LENT.update(before)


def effect_named(name: str) -> Effect:
    """Return one effect, loading only its file. Raises ParameterError when the catalogue lacks the name."""
    if name in _own_names():
        return importlib.import_module(f"rsea_ros.effects.{name}").EFFECT  # type: ignore[no-any-return]
    effects = catalogue()
    if name not in effects:
        known = ", ".join(effects)
        near = did_you_mean(name, effects)
        raise ParameterError(f"effect {quote(name)}: not in the catalogue, expected one of {known}{near}")
    return effects[name]


def look_alikes(name: str, effects: Iterable[Effect]) -> list[Effect]:
    """Return the effects among some that list another as a look-alike, or that it lists."""
    confused = effect_named(name).claims.confusable_with
    return [e for e in effects if e.name in confused or name in e.claims.confusable_with]


@lru_cache(maxsize=1)
def _own_names() -> frozenset[str]:
    names = (m.name for m in pkgutil.iter_modules([str(Path(__file__).parent)]))
    return frozenset(n for n in names if n not in _NOT_EFFECTS and not n.startswith("_"))


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
        look = [f"  look at: {self.effect.inspect}"] if self.effect.inspect else []
        return "\n".join([f"{self.name}: {self.effect.about}", f"  {self.equation}", *rows, *look])

    @staticmethod
    def grows_with(parameter: Parameter) -> str:
        """Return with which numbers of the machine bounds and sizes grow, as a fraction; empty for none."""
        powers = () if parameter.is_fixed else POWERS.get(parameter.unit, ())
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
