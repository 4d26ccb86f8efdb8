"""Which causes may contain a simpler one: Stribeck friction contains Coulomb friction.

A cause may contain another if both act at the same place and have a size of the same unit. Its main parameter
is then that of the other, parameters of equal name are the same, and one that may be zero is what it adds.
The fit shows whether it does contain it: it begins at the other, and must fit no worse.
"""

from __future__ import annotations

from collections.abc import Sequence

from rsea_ros.effects.catalogue import effect_named

NOTHING = "nothing"
"""Name of the hypothesis that the rig, its values fitted, is all that there is."""


def may_contain(name: str, simpler: str) -> bool:
    """Return whether a cause may contain another of fewer parameters."""
    if NOTHING in (name, simpler) or name == simpler:
        return False
    effect, other = effect_named(name), effect_named(simpler)
    is_alike = effect.port == other.port and effect.main.unit == other.main.unit
    return is_alike and len(effect.parameters) > len(other.parameters)


def shared_parameters(name: str, simpler: str) -> dict[str, str]:
    """Return the parameters of a cause that are those of another, with the other's name for each."""
    effect, other = effect_named(name), effect_named(simpler)
    equal = {p.name for p in other.parameters} - {other.main.name}
    same = {p.name: p.name for p in effect.parameters if p.name in equal}
    return same | {effect.main.name: other.main.name}


def addition_to(name: str, simpler: str, unknowns: Sequence[str]) -> int | None:
    """Return the place of what a cause adds to another among the unknowns; None where it cannot contain it.

    unknowns: as `cause.parameter`.
    """
    if not may_contain(name, simpler):
        return None
    same = shared_parameters(name, simpler)
    for p in effect_named(name).parameters:
        is_added = p.name not in same and p.null == 0.0 and not p.logarithmic
        if is_added and f"{name}.{p.name}" in unknowns:
            return unknowns.index(f"{name}.{p.name}")
    return None
