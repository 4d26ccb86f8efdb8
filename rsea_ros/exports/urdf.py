"""A rig as URDF, and as SDF, with a block of our own for what they have no words for.

URDF: joint dynamics (damping, friction) and limits, mimic joints (ROS, urdf/XML). SDF 1.11: besides those a
spring in the joint's dynamics and the stiffness of a limit. The block `rsea` holds every value and effect of
the rig; other programs pass it by.
"""

from __future__ import annotations

import math
from typing import Any
from xml.etree import ElementTree as xml

from rsea_ros.effects.catalogue import effect_named
from rsea_ros.exports.chain import WORLD, Chain, Joint, Link, chain_of
from rsea_ros.exports.coverage import Export, Said, Unsaid, coverage_lines
from rsea_ros.exports.others import acting, sized
from rsea_ros.model.rig import Rig

NAMESPACE = "urn:rsea_ros:rig"
"""Of our block in SDF, which wants a prefix for elements that it does not know."""


def export_urdf(rig: Rig) -> Export:
    """Return the URDF of a rig. Raises RigError for one that is no chain of links (see chain.py)."""
    rig = acting(rig)
    chain = chain_of(rig)
    said, unsaid = _coverage(rig, chain, has_springs=False)
    robot = xml.Element("robot", name=rig.name)
    robot.append(_comment(said, unsaid))
    xml.SubElement(robot, "link", name=WORLD)
    for link in chain.links:
        robot.append(_urdf_link(link))
    for joint in chain.joints:
        robot.append(_urdf_joint(joint, rig))
    robot.append(_block("rsea", rig))
    return Export("urdf", ".urdf", _text(robot), said, unsaid)


def export_sdf(rig: Rig) -> Export:
    """Return the SDF of a rig. Raises RigError for one that is no chain of links (see chain.py)."""
    rig = acting(rig)
    chain = chain_of(rig)
    said, unsaid = _coverage(rig, chain, has_springs=True)
    root = xml.Element("sdf", {"version": "1.11", "xmlns:rsea": NAMESPACE})
    model = xml.SubElement(root, "model", name=rig.name)
    model.append(_comment(said, unsaid))
    for link in chain.links:
        model.append(_sdf_link(link))
    for joint in chain.joints:
        model.append(_sdf_joint(joint, rig))
    model.append(_block("rsea:rig", rig))
    return Export("sdf", ".sdf", _text(root), said, unsaid)


def _coverage(rig: Rig, chain: Chain, *, has_springs: bool) -> tuple[tuple[Said, ...], tuple[Unsaid, ...]]:
    """Return what the joints say, and what only the block does."""
    only = "only in the block rsea"
    said = [Said(one.name, _how(one, has_springs)) for one in chain.joints]
    unsaid = [Unsaid(name, f"{why}; {only}") for name, why in chain.left_out.items()]
    if not has_springs and not rig.rigid_spring:
        unsaid.append(Unsaid("spring.stiffness", f"URDF joints have no spring; {only}"))
    finite = sized(rig)
    for one in rig.effects:
        how = _EFFECTS.get(one.name)
        if one.name not in finite:
            unsaid.append(Unsaid(one.name, f"a parameter of it is infinite; {only}"))
        elif how is None or (one.name == "hard_stop" and not _stop(rig, chain)):
            unsaid.append(Unsaid(one.name, only))
        else:
            said.append(Said(one.name, how))
    if rig.loop is not None:
        unsaid.append(Unsaid(f"{rig.loop} loop", f"a controller's affair; {only}"))
    return tuple(said), tuple(unsaid)


_EFFECTS = {
    "coulomb_friction": "dynamics friction of the gear",
    "torque_saturation": "limit effort of the gear",
    "hard_stop": "limits of the spring's joint",
    "gravity_error": "mass of the free end",
}


def _how(joint: Joint, has_springs: bool) -> str:
    if joint.mimics:
        return f"mimics {joint.mimics}, {joint.multiplier:g} turns for one"
    spring = f", spring {joint.stiffness:g} N m/rad" if has_springs and joint.stiffness else ""
    return f"damping {joint.damping:g} N m s/rad{spring}"


def _stop(rig: Rig, chain: Chain) -> dict[str, float]:
    """Return the hard stop of the spring where the spring has a joint to itself."""
    has_joint = any(joint.name == "spring" for joint in chain.joints)
    return dict(_parameters(rig, "hard_stop")) if has_joint else {}


def _parameters(rig: Rig, name: str) -> dict[str, float]:
    return sized(rig).get(name, {})


def _urdf_link(link: Link) -> xml.Element:
    element = xml.Element("link", name=link.name)
    inertial = xml.SubElement(element, "inertial")
    y, z = link.centre
    xml.SubElement(inertial, "origin", xyz=f"0 {y!r} {z!r}")
    xml.SubElement(inertial, "mass", value=repr(link.mass))
    xml.SubElement(inertial, "inertia", _inertia(link))
    return element


def _inertia(link: Link) -> dict[str, str]:
    diagonal = repr(link.about_centre)
    return {"ixx": diagonal, "iyy": diagonal, "izz": diagonal, "ixy": "0", "ixz": "0", "iyz": "0"}


def _urdf_joint(joint: Joint, rig: Rig) -> xml.Element:
    stop = _parameters(rig, "hard_stop") if joint.name == "spring" else {}
    element = xml.Element("joint", name=joint.name, type="revolute" if stop else "continuous")
    xml.SubElement(element, "parent", link=joint.parent)
    xml.SubElement(element, "child", link=joint.child)
    xml.SubElement(element, "axis", xyz="-1 0 0" if joint.is_turned else "1 0 0")
    xml.SubElement(element, "dynamics", damping=repr(joint.damping), friction=repr(_friction(joint, rig)))
    limits = {"lower": repr(-stop["angle"]), "upper": repr(stop["angle"])} if stop else {}
    effort = _effort(joint, rig)
    if limits or math.isfinite(effort):
        speed = {"effort": repr(effort if math.isfinite(effort) else 1e9), "velocity": "1e9"}
        xml.SubElement(element, "limit", {**limits, **speed})
    if joint.mimics:
        xml.SubElement(element, "mimic", joint=joint.mimics, multiplier=repr(joint.multiplier), offset="0")
    return element


def _friction(joint: Joint, rig: Rig) -> float:
    return _parameters(rig, "coulomb_friction").get("torque", 0.0) if joint.name == "gear" else 0.0


def _effort(joint: Joint, rig: Rig) -> float:
    return _parameters(rig, "torque_saturation").get("limit", math.inf) if joint.name == "gear" else math.inf


def _sdf_link(link: Link) -> xml.Element:
    element = xml.Element("link", name=link.name)
    inertial = xml.SubElement(element, "inertial")
    y, z = link.centre
    xml.SubElement(inertial, "pose").text = f"0 {y!r} {z!r} 0 0 0"
    xml.SubElement(inertial, "mass").text = repr(link.mass)
    inertia = xml.SubElement(inertial, "inertia")
    for name, value in _inertia(link).items():
        xml.SubElement(inertia, name).text = value
    return element


def _sdf_joint(joint: Joint, rig: Rig) -> xml.Element:
    element = xml.Element("joint", name=joint.name, type="revolute")
    xml.SubElement(element, "parent").text = joint.parent
    xml.SubElement(element, "child").text = joint.child
    axis = xml.SubElement(element, "axis")
    xml.SubElement(axis, "xyz").text = "-1 0 0" if joint.is_turned else "1 0 0"
    dynamics = {"damping": joint.damping, "friction": _friction(joint, rig)}
    if joint.stiffness:
        dynamics |= {"spring_reference": 0.0, "spring_stiffness": joint.stiffness}
    _numbers(xml.SubElement(axis, "dynamics"), dynamics)
    stop = _parameters(rig, "hard_stop") if joint.name == "spring" else {}
    limits = {"lower": -stop["angle"], "upper": stop["angle"], "stiffness": stop["stiffness"]} if stop else {}
    if math.isfinite(_effort(joint, rig)):
        limits["effort"] = _effort(joint, rig)
    if limits:
        _numbers(xml.SubElement(axis, "limit"), limits)
    if joint.mimics:
        mimic = xml.SubElement(axis, "mimic", joint=joint.mimics)
        _numbers(mimic, {"multiplier": joint.multiplier, "offset": 0.0, "reference": 0.0})
    return element


def _numbers(element: xml.Element, values: dict[str, float]) -> None:
    for name, value in values.items():
        xml.SubElement(element, name).text = repr(value)


def _block(tag: str, rig: Rig) -> xml.Element:
    """Return every value and effect of the rig; in SDF each element with the prefix of the block."""
    prefix = f"{tag.partition(':')[0]}:" if ":" in tag else ""
    block = xml.Element(tag, name=rig.name, train=rig.train)
    for name, number in rig.values().items():
        xml.SubElement(block, f"{prefix}value", name=name, unit=rig.unit(name), value=repr(number))
    for one in rig.effects:
        effect = xml.SubElement(block, f"{prefix}effect", name=one.name)
        for p in effect_named(one.name).parameters:
            if p.name in one.parameters:
                value = repr(one.parameters[p.name])
                xml.SubElement(effect, f"{prefix}parameter", name=p.name, unit=p.unit, value=value)
    return block


def _comment(said: tuple[Said, ...], unsaid: tuple[Unsaid, ...]) -> Any:
    lines = ["rsea export", *coverage_lines(said, unsaid)]
    return xml.Comment(" " + "\n       ".join(lines).replace("--", "- -") + " ")


def _text(root: xml.Element) -> str:
    xml.indent(root)
    return '<?xml version="1.0"?>\n' + xml.tostring(root, encoding="unicode") + "\n"
