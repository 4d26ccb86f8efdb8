"""MJCF export: the XML's bodies, tendons and equalities are the rig's equations of motion."""

from __future__ import annotations

from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import assume, given, settings
from random_rigs import rigs

from rsea_ros.design.mujoco_model import mjcf
from rsea_ros.documents.units import STANDARD_GRAVITY
from rsea_ros.errors import RigError
from rsea_ros.model.equations import mechanics
from rsea_ros.model.rig_file import load_rig
from rsea_ros.paper.rival_models import lumped_rig

S = 2j * np.pi * np.array([0.3, 2.0, 11.0, 70.0])


def floats(node, key, default="0"):
    return np.array([float(v) for v in node.get(key, default).split()])


def chains(root):
    """Return every body with a hinge, and what it adds of each hinge to the body's absolute angle."""
    parent = {child: node for node in root.iter() for child in node}
    joints = [j.get("name") for body in root.iter("body") for j in body.findall("joint")]
    bodies, rows = list(root.iter("body")), []
    for body in bodies:
        row, node = np.zeros(len(joints)), body
        while node.tag == "body":
            row[joints.index(node.find("joint").get("name"))] = 1.0
            node = parent[node]
        rows.append(row)
    return bodies, joints, np.array(rows)


def matrices(text):
    """Return mass, damping and stiffness of the small motions, read from the XML alone, and the joints.

    The last value has the constraints: rows over the hinge angles whose product is zero.
    """
    root = ElementTree.fromstring(text)
    bodies, joints, absolute = chains(root)
    mass, damping, stiffness = (np.zeros((len(joints), len(joints))) for _ in range(3))
    for i, (body, row) in enumerate(zip(bodies, absolute, strict=True)):
        joint, inertial = body.find("joint"), body.find("inertial")
        arm, weight = -floats(inertial, "pos")[1], floats(inertial, "mass")[0]
        mass += (floats(inertial, "diaginertia")[2] + weight * arm**2) * np.outer(row, row)
        damping[i, i] += floats(joint, "damping")[0]
        stiffness[i, i] += floats(joint, "stiffness")[0]
        stiffness += weight * STANDARD_GRAVITY * arm * np.outer(row, row)
    rows = {}
    for tendon in root.iter("fixed"):
        row = np.zeros(len(joints))
        for joint in tendon:
            row[joints.index(joint.get("joint"))] += float(joint.get("coef"))
        rows[tendon.get("name")] = row
        damping += floats(tendon, "damping")[0] * np.outer(row, row)
        stiffness += floats(tendon, "stiffness")[0] * np.outer(row, row)
    tied = [rows[node.get("tendon1")] for node in root.findall("equality/tendon")]
    return mass, damping, stiffness, joints, tied


def characteristic(mass, damping, stiffness):
    """Return det(M s^2 + D s + K) / det M at some s, which does not depend on the choice of coordinates."""
    return np.array([np.linalg.det(mass * s**2 + damping * s + stiffness) for s in S]) / np.linalg.det(mass)


@settings(max_examples=30)
@given(rigs(gravity=True))
def test_the_xml_holds_the_rigs_equations_of_motion(rig):
    assume(not rig.rigid_spring)
    mass, damping, stiffness, joints, tied = matrices(mjcf(rig))
    keep = np.eye(len(joints))
    for row in tied:  # the hinge with the largest factor follows from the others
        k = int(np.argmax(np.abs(row)))
        keep[k] = -row / row[k]
        keep = np.delete(keep, k, axis=1)
    ours = mechanics(rig)
    actual = [keep.T @ m @ keep for m in (mass, damping, stiffness)]
    assert actual[0].shape == ours.mass.shape
    expected = characteristic(ours.mass, ours.damping, ours.stiffness)
    np.testing.assert_allclose(characteristic(*actual), expected, rtol=1e-6)


def test_a_rig_that_mujoco_cannot_represent_is_refused():
    with pytest.raises(RigError, match="a rigid spring cannot be exported"):
        mjcf(load_rig("bare_drive"))
    with pytest.raises(RigError, match="lumped train cannot be exported"):
        mjcf(lumped_rig(load_rig("paper_moving_output")))
    light = replace(load_rig("paper_moving_output")).with_values({"chassis.inertia": 0.0})
    with pytest.raises(RigError, match="chassis has inertia 0 kg·m²"):
        mjcf(light)
