"""A rig as SDF 1.11: besides what URDF has a spring in the joint's dynamics and the stiffness of a limit."""

from __future__ import annotations

import math
from xml.etree import ElementTree as xml

from rsea_ros.exports.chain import Joint, Link
from rsea_ros.exports.links_and_joints import Language, effort, export_chain, friction, inertia, stop_of
from rsea_ros.exports.represented import Export
from rsea_ros.model.rig import Rig

NAMESPACE = "urn:rsea_ros:rig"
"""Of our block, because SDF wants a prefix for elements that it does not know."""


def export_sdf(rig: Rig) -> Export:
    """Return the SDF of a rig. Raises RigError for one that is no chain of links (see chain.py)."""
    return export_chain(rig, Language("sdf", True, _model, _link, _joint, "rsea:rig"))


def _model(name: str) -> tuple[xml.Element, xml.Element]:
    root = xml.Element("sdf", {"version": "1.11", "xmlns:rsea": NAMESPACE})
    return root, xml.SubElement(root, "model", name=name)


def _link(link: Link) -> xml.Element:
    element = xml.Element("link", name=link.name)
    inertial = xml.SubElement(element, "inertial")
    y, z = link.centre
    xml.SubElement(inertial, "pose").text = f"0 {y!r} {z!r} 0 0 0"
    xml.SubElement(inertial, "mass").text = repr(link.mass)
    matrix = xml.SubElement(inertial, "inertia")
    for name, value in inertia(link).items():
        xml.SubElement(matrix, name).text = value
    return element


def _joint(joint: Joint, rig: Rig) -> xml.Element:
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
