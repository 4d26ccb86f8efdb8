"""The catalogue: every file of this folder that has an `EFFECT`, and files that a user adds."""

from __future__ import annotations

import importlib
import os
import pkgutil
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from types import MappingProxyType

from rsea_ros.documents.wording import did_you_mean, quote
from rsea_ros.effects.effect import Effect
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
