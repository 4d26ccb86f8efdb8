"""Effects in the terms of another simulator, and what is left out."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any
from xml.etree import ElementTree as xml

from rsea_ros.documents.units import plain
from rsea_ros.effects.catalogue import effect_named
from rsea_ros.errors import RigError
from rsea_ros.model.equations import rotor_inertia, train_ratio
from rsea_ros.model.rig import END_NAMES, Rig
from rsea_ros.records.record import FloatArray


class Unrepresentable(Exception):
    """Raised by the translation of an effect that the target has no words for; the text says why."""


@dataclass(frozen=True)
class Export:
    """The file for a target. content: text, the bytes of an archive, or the texts of several files by name.

    says: the parts of a rig that the target has, in its terms. leaves_out: the others, and what it lacks.
    play: its measurements at the beginning of each command's hold, of content, rig and commands at RATE.
    """

    target: str
    suffix: str
    content: str | bytes | Mapping[str, str]
    says: Mapping[str, str]
    leaves_out: Mapping[str, str]
    play: Callable[[Any, Rig, FloatArray], Mapping[str, FloatArray]] | None = None


def check_rotary(rig: Rig) -> None:
    """Raise RigError for a rig that moves along a line: the joints and bodies of exports turn."""
    if rig.linear:
        raise RigError(f"rig {rig.name}: moves along a line, expected a rotary rig for this target")


def coverage_lines(says: Mapping[str, str], leaves_out: Mapping[str, str]) -> list[str]:
    """Return both for people, a line each."""
    lines = [f"says {name}: {how}" for name, how in says.items()]
    return [*lines, *(f"leaves out {name}: {why}" for name, why in leaves_out.items())]


def coverage_comment(says: Mapping[str, str], leaves_out: Mapping[str, str]) -> Any:
    """Return both as a comment of XML."""
    lines = ["rsea export", *coverage_lines(says, leaves_out)]
    return xml.Comment(" " + "\n       ".join(lines).replace("--", "- -") + " ")


def without_null_effects(rig: Rig) -> Rig:
    """Return the rig without the effects that have no size: all parameters at their null values."""
    named = ((one, effect_named(one.name)) for one in rig.effects)
    return rig.with_effects(*(one for one, e in named if e.complete(one.parameters) != e.null))


def finite_sizes(rig: Rig) -> dict[str, dict[str, float]]:
    """Return the parameters of the effects whose every size is a finite number, by name."""
    complete = {one.name: effect_named(one.name).complete(one.parameters) for one in rig.effects}
    return {name: p for name, p in complete.items() if all(map(math.isfinite, p.values()))}


def pd_gains(rig: Rig) -> tuple[float, float]:
    """Return the gains of a rig's loop on position, N m/rad, and on speed, N m s/rad."""
    if rig.loop != "cascade":
        return rig["controller.k_p"], rig["controller.k_d"]
    return rig["controller.k_pos"] * rig["controller.k_v"], rig["controller.k_v"]


def dry_friction(effects: Mapping[str, Mapping[str, float]]) -> tuple[float, float, float]:
    """Return what all effects of dry friction make at speed and more at rest, N m, and up to where, rad/s."""
    coulomb, stribeck, speed = effects.get("coulomb_friction", {}).get("torque", 0.0), 0.0, 1.0
    for p in (effects[name] for name in ("stribeck_friction", "lugre_friction") if name in effects):
        coulomb, stribeck = coulomb + p["coulomb_torque"], stribeck + p["stribeck_torque"]
        speed = p["stribeck_velocity"]
    return coulomb, stribeck, speed


def command_limit(rig: Rig) -> float:
    """Return the largest torque that the rig's loop commands, N m; infinite where it states none."""
    return min(rig["controller.torque_limit"], rig.controller.limit if rig.controller else math.inf)


def omitted_effects(rig: Rig, says: Mapping[str, str], why: str) -> dict[str, str]:
    """Return the rig's effects that the target does not represent."""
    finite, effects = finite_sizes(rig), (one.name for one in rig.effects if one.name not in says)
    return {name: why if name in finite else "a parameter of it is infinite" for name in effects}


def omitted_terms(rig: Rig, why: Mapping[str, str]) -> dict[str, str]:
    """Return the terms of a rig's loop that act and that the target lacks, by the reasons `why`."""
    values = rig.values()
    sizes = {name: values.get(f"controller.{name}", 0.0) for name in why}
    return {f"controller.{n}": why[n] for n, v in sizes.items() if v and math.isfinite(v)}


def omitted_parts(rig: Rig, why: str) -> dict[str, str]:
    """Return the bodies, springs and sensors that a target of one rigid joint leaves out.

    Also the coupling n J_r of rotor and housing, which an armature, n^2 J_r alone, does not have.
    """
    left: dict[str, str] = {}
    if rig["chassis.inertia"]:
        weight = f"{rig['chassis.inertia']:g} {plain(rig.unit('chassis.inertia'))}"
        left["chassis.inertia"] = f"{weight}; add it to the link behind the joint"
    if rig.train != "lumped" and not rig.linear and rotor_inertia(rig):
        n = train_ratio(rig)
        spin = f"{n * rotor_inertia(rig):.3g} {plain(rig.unit('rotor.reflected_inertia'))}"
        left["gear.train"] = f"{rig.train}, n = {n:g}: an armature does not turn; its spin n J_r is {spin}"
    if not rig.rigid_spring:
        left["spring"] = f"{rig['spring.stiffness']:g} N·m/rad; {why}"
    stiff = [f"{name}.stiffness" for name in ("gear", "proximal_spring")]
    left |= {name: why for name in stiff if math.isfinite(rig[name])}
    load = "its load is the affair of the robot's own links"
    left |= {end: load for end in END_NAMES if rig.end_is_free(end)}
    return left | omitted_sensors(rig, "the target's observations have their own")


def omitted_sensors(rig: Rig, noise: str) -> dict[str, str]:
    """Return what the rig states of its sensors, which no target reads as they do. noise: why not theirs."""
    late = {f"sensors.{n}.delay": s.delay for n, s in rig.sensors.items() if s.delay}
    left = {name: f"{1e3 * delay:g} ms; read the output so much later" for name, delay in late.items()}
    left |= {f"sensors.{n}.filter": f"{f.kind}; pass the output through it" for n, f in rig.filters().items()}
    return {"sensor noise": noise, **left} if rig.sensors else {}


_LONGEST = 60
"""Characters of a rig's name in that of a model or a function, which is that of a file too."""


def identifier(name: str) -> str:
    """Return a name as FMI and C want it: letters, digits and underscores, a letter first."""
    kept = "".join(c if c.isascii() and c.isalnum() else "_" for c in name[:_LONGEST])
    return kept if kept[:1].isalpha() else f"rig_{kept}"
