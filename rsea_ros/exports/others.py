"""Parts that targets without a spring or without sensor dynamics leave out."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from rsea_ros.effects.catalogue import effect_named
from rsea_ros.exports.represented import Omitted, Represented
from rsea_ros.model.rig import Rig
from rsea_ros.model.rig_fields import END_NAMES


def acting(rig: Rig) -> Rig:
    """Return the rig without the effects that have no size: all parameters at their null values."""
    named = ((one, effect_named(one.name)) for one in rig.effects)
    return rig.with_effects(*(one for one, e in named if e.complete(one.parameters) != e.null))


def sized(rig: Rig) -> dict[str, dict[str, float]]:
    """Return the parameters of the effects whose every size is a finite number, by name."""
    complete = {one.name: effect_named(one.name).complete(one.parameters) for one in rig.effects}
    return {name: p for name, p in complete.items() if all(map(math.isfinite, p.values()))}


def omitted_effects(rig: Rig, represented: Sequence[Represented], why: str) -> list[Omitted]:
    """Return the rig's effects that the target does not represent."""
    names, finite = {one.name for one in represented}, sized(rig)
    endless = "a parameter of it is infinite"
    effects = (one.name for one in rig.effects if one.name not in names)
    return [Omitted(name, why if name in finite else endless) for name in effects]


def omitted_parts(rig: Rig, why: str) -> Iterator[Omitted]:
    """Yield the springs, loads and sensors that a target of one rigid joint leaves out."""
    if not rig.rigid_spring:
        yield Omitted("spring", f"{rig['spring.stiffness']:g} N·m/rad; {why}")
    for name in ("gear", "proximal_spring"):
        if math.isfinite(rig[f"{name}.stiffness"]):
            yield Omitted(f"{name}.stiffness", why)
    for end in END_NAMES:
        if rig.end_is_free(end):
            yield Omitted(end, "its load is the affair of the robot's own links")
    if rig.sensors:
        yield Omitted("sensor noise", "the target's observations have their own")
