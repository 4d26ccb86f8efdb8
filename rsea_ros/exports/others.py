"""Effects in the terms of another simulator, and what is left out."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any
from xml.etree import ElementTree as xml

from rsea_ros.documents.units import plain
from rsea_ros.effects.catalogue import effect_named
from rsea_ros.model.equations import rotor_inertia, train_ratio
from rsea_ros.model.rig import END_NAMES, Rig


@dataclass(frozen=True)
class Represented:
    """Something of a rig that the target has. how: in the target's terms."""

    name: str
    how: str


@dataclass(frozen=True)
class Omitted:
    """A part of a rig that the file leaves out. why: the feature that the target lacks."""

    name: str
    why: str


class Unrepresentable(Exception):
    """Raised by the translation of an effect that the target has no words for; the text says why."""


@dataclass(frozen=True)
class Export:
    """The file for a target, with exported and omitted parts. content: text or the bytes of an archive."""

    target: str
    suffix: str
    content: str | bytes
    represented: tuple[Represented, ...]
    omitted: tuple[Omitted, ...]


def coverage_lines(represented: Iterable[Represented], omitted: Iterable[Omitted]) -> list[str]:
    """Return both lists for people, a line each."""
    lines = [f"says {one.name}: {one.how}" for one in represented]
    return [*lines, *(f"leaves out {one.name}: {one.why}" for one in omitted)]


def coverage_comment(represented: Iterable[Represented], omitted: Iterable[Omitted]) -> Any:
    """Return both lists as a comment of XML."""
    lines = ["rsea export", *coverage_lines(represented, omitted)]
    return xml.Comment(" " + "\n       ".join(lines).replace("--", "- -") + " ")


def without_null_effects(rig: Rig) -> Rig:
    """Return the rig without the effects that have no size: all parameters at their null values."""
    named = ((one, effect_named(one.name)) for one in rig.effects)
    return rig.with_effects(*(one for one, e in named if e.complete(one.parameters) != e.null))


def finite_sizes(rig: Rig) -> dict[str, dict[str, float]]:
    """Return the parameters of the effects whose every size is a finite number, by name."""
    complete = {one.name: effect_named(one.name).complete(one.parameters) for one in rig.effects}
    return {name: p for name, p in complete.items() if all(map(math.isfinite, p.values()))}


def omitted_effects(rig: Rig, represented: Sequence[Represented], why: str) -> list[Omitted]:
    """Return the rig's effects that the target does not represent."""
    names, finite = {one.name for one in represented}, finite_sizes(rig)
    endless = "a parameter of it is infinite"
    effects = (one.name for one in rig.effects if one.name not in names)
    return [Omitted(name, why if name in finite else endless) for name in effects]


def omitted_terms(rig: Rig, why: Mapping[str, str]) -> list[Omitted]:
    """Return the terms of a rig's loop that act and that the target lacks, by the reasons `why`."""
    values = rig.values()
    sizes = {name: values.get(f"controller.{name}", 0.0) for name in why}
    return [Omitted(f"controller.{n}", why[n]) for n, v in sizes.items() if v and math.isfinite(v)]


def _spin(rig: Rig) -> Iterator[Omitted]:
    """Yield the coupling n J_r of rotor and housing, which an armature, n^2 J_r alone, does not have."""
    n = train_ratio(rig)
    if rig.train == "lumped" or rig.linear or not rotor_inertia(rig):
        return
    spin = f"{n * rotor_inertia(rig):.3g} {plain(rig.unit('rotor.reflected_inertia'))}"
    why = f"{rig.train}, n = {n:g}: an armature does not turn; its spin n J_r is {spin}"
    yield Omitted("gear.train", why)


def omitted_parts(rig: Rig, why: str) -> Iterator[Omitted]:
    """Yield the bodies, springs and sensors that a target of one rigid joint leaves out."""
    if rig["chassis.inertia"]:
        weight = f"{rig['chassis.inertia']:g} {plain(rig.unit('chassis.inertia'))}"
        yield Omitted("chassis.inertia", f"{weight}; add it to the link behind the joint")
    yield from _spin(rig)
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
