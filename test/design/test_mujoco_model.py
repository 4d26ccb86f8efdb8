"""MJCF export: the XML's bodies, tendons and equalities are the rig's equations of motion."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import assume, given, settings

from rsea_ros.cli.main import main
from rsea_ros.design import mesh
from rsea_ros.design import mujoco_model as mjcf_module
from rsea_ros.design.mujoco_model import mjcf
from rsea_ros.documents.units import STANDARD_GRAVITY
from rsea_ros.errors import RigError
from rsea_ros.model.equations import mechanics
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.train import TRAINS
from rsea_ros.paper.rival_models import lumped_rig

sys.path.append(str(Path(__file__).parents[1] / "model"))
from random_rigs import rigs
from rolling import rotor_speed

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


def test_the_xml_has_the_inertias_of_the_knee():
    root = ElementTree.fromstring(mjcf(load_rig("prototype_knee")))
    actual = {body.get("name"): floats(body.find("inertial"), "diaginertia")[2] for body in root.iter("body")}
    assert actual == pytest.approx({"housing": 0.25, "rotor": 1.2 / 160**2, "chassis": 6.169e-4})


@pytest.mark.parametrize("train", [t for t in TRAINS if t != "lumped"])
def test_the_bodies_turn_as_the_teeth_do(train):
    """The hinges' tie and the chain of bearings alone make the rotor's speed, as rolling contacts do."""
    rig = replace(load_rig("prototype_knee"), train=train)
    root = ElementTree.fromstring(mjcf(rig))
    bodies, joints, absolute = chains(root)
    _, _, _, _, (tie,) = matrices(mjcf(rig))
    of = {body.get("name"): row for body, row in zip(bodies, absolute, strict=True)}
    for housing, output in ((0.0, 1.0), (1.0, 0.0), (0.3, -2.0)):
        speeds = np.linalg.solve([of["housing"], of["chassis"], tie], [housing, output, 0.0])
        expected = rotor_speed(train, rig["gear.ratio"], housing, output)
        assert of["rotor"] @ speeds == pytest.approx(expected, rel=1e-9)
    assert len(joints) == 3


def test_the_export_knows_no_formula_of_the_train():
    for module in (mjcf_module, mesh):
        assert not {"train_ratio", "rotor_turns", "spin_inertia"} & set(vars(module))


def test_a_rig_that_mujoco_cannot_represent_is_refused():
    with pytest.raises(RigError, match="a rigid spring cannot be exported"):
        mjcf(load_rig("bare_drive"))
    with pytest.raises(RigError, match="lumped train cannot be exported"):
        mjcf(lumped_rig(load_rig("paper_moving_output")))
    light = replace(load_rig("paper_moving_output")).with_values({"chassis.inertia": 0.0})
    with pytest.raises(RigError, match="chassis has inertia 0 kg·m²"):
        mjcf(light)


def test_export_writes_the_file(tmp_path, capsys):
    out = tmp_path / "knee.xml"
    assert main(["export", "--mjcf", "prototype_knee", "--out", str(out), "--no-play"]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert said.startswith(f"{out}: MJCF for MuJoCo 4, of prototype_knee")
    assert ElementTree.parse(out).getroot().get("model") == "prototype_knee"
    assert main(["export", "--mjcf", "no_such_rig"]) == 2
    assert capsys.readouterr().err.startswith("rsea export: rig 'no_such_rig' not found")
