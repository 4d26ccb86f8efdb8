"""The catalogue of physical effects: one file each, see effect.py.

The package is also a mapping: `rsea_ros.effects["backlash"]` shows equation, parameters and source, and
iteration gives the names.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from types import ModuleType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rsea_ros.effects.catalogue import EffectPage


class _Catalogue(ModuleType):
    """The package itself, with effects by name; those of RSEA_EFFECTS included."""

    def __getitem__(self, name: str) -> EffectPage:
        from rsea_ros.effects.catalogue import EffectPage, effect_named

        return EffectPage(effect_named(name))

    def __iter__(self) -> Iterator[str]:
        from rsea_ros.effects.catalogue import catalogue

        return iter(catalogue())

    def __len__(self) -> int:
        from rsea_ros.effects.catalogue import catalogue

        return len(catalogue())

    def __contains__(self, name: object) -> bool:
        return name in list(self)

    def __repr__(self) -> str:
        """Return name and meaning of every effect, one per line."""
        width = max(map(len, self))
        return "\n".join(f"{name:<{width}}  {self[name].about}" for name in self)

    def _repr_html_(self) -> str:
        from rsea_ros.effects.catalogue import catalogue_table

        return catalogue_table([self[name] for name in self])


sys.modules[__name__].__class__ = _Catalogue
