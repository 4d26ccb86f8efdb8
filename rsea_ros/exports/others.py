"""What targets without a spring or without dynamics of sensors leave out, said in one place."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from rsea_ros.exports.coverage import Said, Unsaid
from rsea_ros.model.rig import END_NAMES, Rig


def unsaid_effects(rig: Rig, said: Sequence[Said], why: str) -> list[Unsaid]:
    """Return the rig's effects that are not said."""
    names = {one.name for one in said}
    return [Unsaid(one.name, why) for one in rig.effects if one.name not in names]


def unsaid_parts(rig: Rig, why: str) -> Iterator[Unsaid]:
    """Yield the springs, loads and sensors that a target of one rigid joint leaves out."""
    if not rig.rigid_spring:
        yield Unsaid("spring", f"{rig['spring.stiffness']:g} N m/rad; {why}")
    for name in ("gear", "proximal_spring"):
        if math.isfinite(rig[f"{name}.stiffness"]):
            yield Unsaid(f"{name}.stiffness", why)
    for end in END_NAMES:
        if rig.end_is_free(end):
            yield Unsaid(end, "its load is the affair of the robot's own links")
    if rig.sensors:
        yield Unsaid("sensor noise", "the target's observations have their own")
