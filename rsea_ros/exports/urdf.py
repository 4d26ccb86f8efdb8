"""A rig as URDF: joint dynamics (damping, friction), limits, mimic joints (ROS, urdf/XML), and our block."""

from __future__ import annotations

import math
from xml.etree import ElementTree as xml

from rsea_ros.exports.chain import WORLD, Joint, Link
from rsea_ros.exports.links_and_joints import Language, effort, export_chain, friction, inertia, stop_of
from rsea_ros.exports.represented import Export
from rsea_ros.model.rig import Rig


def export_urdf(rig: Rig) -> Export:
    """Return the URDF of a rig. Raises RigError for one that is no chain of links (see chain.py)."""
    return export_chain(rig, Language("urdf", False, _robot, _link, _joint, "rsea"))


def _robot(name: str) -> tuple[xml.Element, xml.Element]:
    robot = xml.Element("robot", name=name)
    xml.SubElement(robot, "link", name=WORLD)
    return robot, robot


def _link(link: Link) -> xml.Element:
    element = xml.Element("link", name=link.name)
    inertial = xml.SubElement(element, "inertial")
    y, z = link.centre
    xml.SubElement(inertial, "origin", xyz=f"0 {y!r} {z!r}")
    xml.SubElement(inertial, "mass", value=repr(link.mass))
    xml.SubElement(inertial, "inertia", inertia(link))
    return element


def _joint(joint: Joint, rig: Rig) -> xml.Element:
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
