"""URDF and SDF: links and joints.

The block holds every value and effect of the rig; other programs ignore it.
"""

import math
from collections.abc import Callable
from xml.etree import ElementTree as xml

from rsea_extras.exports.chain import WORLD, Chain, Joint, Link, chain_of
from rsea_ros import Rig
from rsea_ros.extension.base import printable
from rsea_ros.extension.rigs import effect_named
from rsea_ros.extension.target import others

NAMESPACE = "urn:rsea_ros:rig"
"""Of our block, because SDF wants a prefix for elements that it does not know."""


def export_urdf(rig: Rig) -> others.Export:
    """Return the URDF of a rig. Raises RigError for one that is no chain of links (see chain.py)."""
    robot = xml.Element("robot", name=rig.name)
    xml.SubElement(robot, "link", name=WORLD)
    return _export("urdf", rig, robot, robot, _urdf_link, _urdf_joint)


def export_sdf(rig: Rig) -> others.Export:
    """Return the SDF of a rig. Raises RigError for one that is no chain of links (see chain.py)."""
    root = xml.Element("sdf", {"version": "1.11", "xmlns:rsea": NAMESPACE})
    return _export("sdf", rig, root, xml.SubElement(root, "model", name=rig.name), _sdf_link, _sdf_joint)


def _export(
    target: str, rig: Rig, root: xml.Element, model: xml.Element, link: Callable[[Link], xml.Element],
    joint: Callable[[Joint, Rig], xml.Element],
) -> others.Export:  # fmt: skip
    """Return a rig with its links and joints, as a language spells them, and our block in the model."""
    rig = others.without_null_effects(rig)
    chain = chain_of(rig)
    says, left = _coverage(rig, chain, has_springs=target == "sdf")
    model.insert(0, others.coverage_comment(says, left))
    model.extend(link(one) for one in chain.links)
    model.extend(joint(one, rig) for one in chain.joints)
    model.append(_block("rsea:" if target == "sdf" else "", rig))
    xml.indent(root)
    text = '<?xml version="1.0"?>\n' + printable(xml.tostring(root, encoding="unicode")) + "\n"
    return others.Export(target, f".{target}", text, says, left)


def _coverage(rig: Rig, chain: Chain, *, has_springs: bool) -> tuple[dict[str, str], dict[str, str]]:
    """Return the parts in the joints, and those in the block alone."""
    only = "only in the block rsea"
    says = {one.name: _how(one, has_springs) for one in chain.joints}
    left = {name: f"{why}; {only}" for name, why in chain.left_out.items()}
    if not has_springs and not rig.rigid_spring:
        left["spring.stiffness"] = f"URDF joints have no spring; {only}"
    acts = others.finite_sizes(rig).keys() & _EFFECTS
    acts -= set() if any(_acting(joint, rig)[0] for joint in chain.joints) else {"hard_stop"}
    says |= {one.name: _EFFECTS[one.name] for one in rig.effects if one.name in acts}
    left |= others.omitted_effects(rig, says, only) | others.omitted_sensors(rig, only)
    if rig.loop is not None:
        left[f"{rig.loop} loop"] = f"a controller's affair; {only}"
    return says, left


_EFFECTS = {
    "coulomb_friction": "dynamics friction of the gear",
    "torque_saturation": "limit effort of the gear",
    "hard_stop": "limits of the spring's joint",
    "gravity_error": "mass of the free end",
}


def _how(joint: Joint, has_springs: bool) -> str:
    if joint.mimics:
        return f"mimics {joint.mimics}, {joint.multiplier:g} turns for one"
    spring = f", spring {joint.stiffness:g} N·m/rad" if has_springs and joint.stiffness else ""
    return f"damping {joint.damping:g} N·m·s/rad{spring}"


def inertia(link: Link) -> dict[str, str]:
    """Return the inertia of a link about its centre, kg m^2, by the names that both formats use."""
    y, z = link.centre
    diagonal = repr(link.inertia - link.mass * (y * y + z * z))
    return {"ixx": diagonal, "iyy": diagonal, "izz": diagonal, "ixy": "0", "ixz": "0", "iyz": "0"}


def _acting(joint: Joint, rig: Rig) -> tuple[dict[str, float], float, float]:
    """Return the hard stop of a joint (that of the spring), and its dry friction and largest torque, N m."""
    sizes = others.finite_sizes(rig)
    stop = sizes.get("hard_stop", {}) if joint.name == "spring" else {}
    in_gear = sizes if joint.name == "gear" else {}
    friction = in_gear.get("coulomb_friction", {}).get("torque", 0.0)
    return stop, friction, in_gear.get("torque_saturation", {}).get("limit", math.inf)


def _block(prefix: str, rig: Rig) -> xml.Element:
    """Return every value and effect of the rig. prefix: of each element, in SDF."""
    block = xml.Element(f"{prefix}rig" if prefix else "rsea", name=rig.name, train=rig.train)
    for name, number in rig.values().items():
        xml.SubElement(block, f"{prefix}value", name=name, unit=rig.unit(name), value=repr(number))
    for one in rig.effects:
        effect = xml.SubElement(block, f"{prefix}effect", name=one.name)
        for p in effect_named(one.name).parameters:
            if p.name in one.parameters:
                value = repr(one.parameters[p.name])
                xml.SubElement(effect, f"{prefix}parameter", name=p.name, unit=p.unit, value=value)
    return block


def _urdf_link(link: Link) -> xml.Element:
    element = xml.Element("link", name=link.name)
    inertial = xml.SubElement(element, "inertial")
    y, z = link.centre
    xml.SubElement(inertial, "origin", xyz=f"0 {y!r} {z!r}")
    xml.SubElement(inertial, "mass", value=repr(link.mass))
    xml.SubElement(inertial, "inertia", inertia(link))
    return element


def _urdf_joint(joint: Joint, rig: Rig) -> xml.Element:
    stop, friction, effort = _acting(joint, rig)
    element = xml.Element("joint", name=joint.name, type="revolute" if stop else "continuous")
    xml.SubElement(element, "parent", link=joint.parent)
    xml.SubElement(element, "child", link=joint.child)
    xml.SubElement(element, "axis", xyz="-1 0 0" if joint.is_turned else "1 0 0")
    xml.SubElement(element, "dynamics", damping=repr(joint.damping), friction=repr(friction))
    limits = {"lower": repr(-stop["angle"]), "upper": repr(stop["angle"])} if stop else {}
    if limits or math.isfinite(effort):
        speed = {"effort": repr(min(effort, 1e9)), "velocity": "1e9"}
        xml.SubElement(element, "limit", {**limits, **speed})
    if joint.mimics:
        xml.SubElement(element, "mimic", joint=joint.mimics, multiplier=repr(joint.multiplier), offset="0")
    return element


def _sdf_link(link: Link) -> xml.Element:
    element = xml.Element("link", name=link.name)
    inertial = xml.SubElement(element, "inertial")
    y, z = link.centre
    xml.SubElement(inertial, "pose").text = f"0 {y!r} {z!r} 0 0 0"
    xml.SubElement(inertial, "mass").text = repr(link.mass)
    matrix = xml.SubElement(inertial, "inertia")
    for name, value in inertia(link).items():
        xml.SubElement(matrix, name).text = value
    return element


def _sdf_joint(joint: Joint, rig: Rig) -> xml.Element:
    element = xml.Element("joint", name=joint.name, type="revolute")
    xml.SubElement(element, "parent").text = joint.parent
    xml.SubElement(element, "child").text = joint.child
    axis = xml.SubElement(element, "axis")
    xml.SubElement(axis, "xyz").text = "-1 0 0" if joint.is_turned else "1 0 0"
    stop, friction, effort = _acting(joint, rig)
    dynamics = {"damping": joint.damping, "friction": friction}
    if joint.stiffness:
        dynamics |= {"spring_reference": 0.0, "spring_stiffness": joint.stiffness}
    _numbers(xml.SubElement(axis, "dynamics"), dynamics)
    limits = {"lower": -stop["angle"], "upper": stop["angle"], "stiffness": stop["stiffness"]} if stop else {}
    if math.isfinite(effort):
        limits["effort"] = effort
    if limits:
        _numbers(xml.SubElement(axis, "limit"), limits)
    if joint.mimics:
        mimic = xml.SubElement(axis, "mimic", joint=joint.mimics)
        _numbers(mimic, {"multiplier": joint.multiplier, "offset": 0.0, "reference": 0.0})
    return element


def _numbers(element: xml.Element, values: dict[str, float]) -> None:
    for name, value in values.items():
        xml.SubElement(element, name).text = repr(value)
