"""URDF and SDF: links and joints.

The block holds every value and effect of the rig; other programs ignore it.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from xml.etree import ElementTree as xml

from rsea_ros.documents.wording import printable
from rsea_ros.effects.catalogue import effect_named
from rsea_ros.exports import others
from rsea_ros.exports.chain import WORLD, Chain, Joint, Link, chain_of
from rsea_ros.model.rig import Rig

Frame = Callable[[str], tuple[xml.Element, xml.Element]]
"""Takes the name of a rig, gives the root of a document and the element in it that holds links and joints."""


@dataclass(frozen=True)
class Language:
    """The spelling of a chain in a format.

    block: the tag of the block with all values and effects of the rig.
    """

    target: str
    has_springs: bool
    frame: Frame
    link: Callable[[Link], xml.Element]
    joint: Callable[[Joint, Rig], xml.Element]
    block: str


def export_chain(rig: Rig, language: Language) -> others.Export:
    """Return a rig in a language. Raises RigError for one that is no chain of links (see chain.py)."""
    rig = others.without_null_effects(rig)
    chain = chain_of(rig)
    says, left = _coverage(rig, chain, has_springs=language.has_springs)
    root, model = language.frame(rig.name)
    model.insert(0, others.coverage_comment(says, left))
    model.extend(language.link(link) for link in chain.links)
    model.extend(language.joint(joint, rig) for joint in chain.joints)
    model.append(_block(language.block, rig))
    return others.Export(language.target, f".{language.target}", _text(root), says, left)


def _coverage(rig: Rig, chain: Chain, *, has_springs: bool) -> tuple[dict[str, str], dict[str, str]]:
    """Return the parts in the joints, and those in the block alone."""
    only = "only in the block rsea"
    says = {one.name: _how(one, has_springs) for one in chain.joints}
    left = {name: f"{why}; {only}" for name, why in chain.left_out.items()}
    if not has_springs and not rig.rigid_spring:
        left["spring.stiffness"] = f"URDF joints have no spring; {only}"
    finite, has_stop = others.finite_sizes(rig), any(stop_of(joint, rig) for joint in chain.joints)
    for one in rig.effects:
        how = _EFFECTS.get(one.name)
        if one.name not in finite:
            left[one.name] = f"a parameter of it is infinite; {only}"
        elif how is None or (one.name == "hard_stop" and not has_stop):
            left[one.name] = only
        else:
            says[one.name] = how
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


def _parameters(rig: Rig, name: str) -> dict[str, float]:
    return others.finite_sizes(rig).get(name, {})


def inertia(link: Link) -> dict[str, str]:
    """Return the inertia of a link about its centre, kg m^2, by the names that both formats use."""
    y, z = link.centre
    diagonal = repr(link.inertia - link.mass * (y * y + z * z))
    return {"ixx": diagonal, "iyy": diagonal, "izz": diagonal, "ixy": "0", "ixz": "0", "iyz": "0"}


def stop_of(joint: Joint, rig: Rig) -> dict[str, float]:
    """Return the parameters of the hard stop in a joint: that of the spring."""
    return _parameters(rig, "hard_stop") if joint.name == "spring" else {}


def friction(joint: Joint, rig: Rig) -> float:
    """Return the dry friction of a joint, N m."""
    return _parameters(rig, "coulomb_friction").get("torque", 0.0) if joint.name == "gear" else 0.0


def effort(joint: Joint, rig: Rig) -> float:
    """Return the largest torque of a joint, N m."""
    return _parameters(rig, "torque_saturation").get("limit", math.inf) if joint.name == "gear" else math.inf


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


def _text(root: xml.Element) -> str:
    xml.indent(root)
    return '<?xml version="1.0"?>\n' + printable(xml.tostring(root, encoding="unicode")) + "\n"


def export_urdf(rig: Rig) -> others.Export:
    """Return the URDF of a rig. Raises RigError for one that is no chain of links (see chain.py)."""
    return export_chain(rig, Language("urdf", False, _robot, _urdf_link, _urdf_joint, "rsea"))


def _robot(name: str) -> tuple[xml.Element, xml.Element]:
    robot = xml.Element("robot", name=name)
    xml.SubElement(robot, "link", name=WORLD)
    return robot, robot


def _urdf_link(link: Link) -> xml.Element:
    element = xml.Element("link", name=link.name)
    inertial = xml.SubElement(element, "inertial")
    y, z = link.centre
    xml.SubElement(inertial, "origin", xyz=f"0 {y!r} {z!r}")
    xml.SubElement(inertial, "mass", value=repr(link.mass))
    xml.SubElement(inertial, "inertia", inertia(link))
    return element


def _urdf_joint(joint: Joint, rig: Rig) -> xml.Element:
    stop = stop_of(joint, rig)
    element = xml.Element("joint", name=joint.name, type="revolute" if stop else "continuous")
    xml.SubElement(element, "parent", link=joint.parent)
    xml.SubElement(element, "child", link=joint.child)
    xml.SubElement(element, "axis", xyz="-1 0 0" if joint.is_turned else "1 0 0")
    xml.SubElement(element, "dynamics", damping=repr(joint.damping), friction=repr(friction(joint, rig)))
    limits = {"lower": repr(-stop["angle"]), "upper": repr(stop["angle"])} if stop else {}
    most = effort(joint, rig)
    if limits or math.isfinite(most):
        speed = {"effort": repr(most if math.isfinite(most) else 1e9), "velocity": "1e9"}
        xml.SubElement(element, "limit", {**limits, **speed})
    if joint.mimics:
        xml.SubElement(element, "mimic", joint=joint.mimics, multiplier=repr(joint.multiplier), offset="0")
    return element


NAMESPACE = "urn:rsea_ros:rig"
"""Of our block, because SDF wants a prefix for elements that it does not know."""


def export_sdf(rig: Rig) -> others.Export:
    """Return the SDF of a rig. Raises RigError for one that is no chain of links (see chain.py)."""
    return export_chain(rig, Language("sdf", True, _model, _sdf_link, _sdf_joint, "rsea:rig"))


def _model(name: str) -> tuple[xml.Element, xml.Element]:
    root = xml.Element("sdf", {"version": "1.11", "xmlns:rsea": NAMESPACE})
    return root, xml.SubElement(root, "model", name=name)


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
    dynamics = {"damping": joint.damping, "friction": friction(joint, rig)}
    if joint.stiffness:
        dynamics |= {"spring_reference": 0.0, "spring_stiffness": joint.stiffness}
    _numbers(xml.SubElement(axis, "dynamics"), dynamics)
    stop = stop_of(joint, rig)
    limits = {"lower": -stop["angle"], "upper": stop["angle"], "stiffness": stop["stiffness"]} if stop else {}
    if math.isfinite(effort(joint, rig)):
        limits["effort"] = effort(joint, rig)
    if limits:
        _numbers(xml.SubElement(axis, "limit"), limits)
    if joint.mimics:
        mimic = xml.SubElement(axis, "mimic", joint=joint.mimics)
        _numbers(mimic, {"multiplier": joint.multiplier, "offset": 0.0, "reference": 0.0})
    return element


def _numbers(element: xml.Element, values: dict[str, float]) -> None:
    for name, value in values.items():
        xml.SubElement(element, name).text = repr(value)
