"""URDF and SDF: their links and joints alone hold the rig's equations of motion."""

from __future__ import annotations

from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest

from rsea_extras.exports.urdf import export_sdf, export_urdf
from rsea_ros.documents.units import STANDARD_GRAVITY
from rsea_ros.errors import RigError
from rsea_ros.exports.mjcf import export_mjcf
from rsea_ros.model.equations import mechanics
from rsea_ros.model.rig_file import load_rig
from rsea_ros.paper.rival_models import lumped_rig

S = 2j * np.pi * np.array([0.3, 2.0, 11.0, 70.0])
LEFT_OUT = {"housing_end.stiffness": 0.0, "housing_end.damping": 0.0}


def tree(text):
    """Return inertias, joints and springs of an SDF: only what its elements say."""
    model = ElementTree.fromstring(text).find("model")
    links = {}
    for link in model.findall("link"):
        _, y, z, *_ = map(float, link.find("inertial/pose").text.split())
        mass = float(link.find("inertial/mass").text)
        about = float(link.find("inertial/inertia/ixx").text)
        links[link.get("name")] = (about + mass * (y**2 + z**2), -mass * STANDARD_GRAVITY * z)
    return links, model.findall("joint")


def matrices(text):
    """Return mass, damping and stiffness of the small motions over the joints that mimic no other."""
    links, joints = tree(text)
    free = [j.get("name") for j in joints if j.find("axis/mimic") is None]
    absolute, local = {"world": np.zeros(len(free))}, {}
    mass, damping, stiffness = (np.zeros((len(free), len(free))) for _ in range(3))
    for joint in joints:
        name, mimic = joint.get("name"), joint.find("axis/mimic")
        sign = float(joint.find("axis/xyz").text.split()[0])
        if mimic is None:
            local[name] = np.eye(len(free))[free.index(name)]
        else:
            local[name] = float(mimic.find("multiplier").text) * local[mimic.get("joint")]
        absolute[joint.find("child").text] = absolute[joint.find("parent").text] + sign * local[name]
        outer = np.outer(local[name], local[name])
        damping += float(joint.findtext("axis/dynamics/damping", "0")) * outer
        stiffness += float(joint.findtext("axis/dynamics/spring_stiffness", "0")) * outer
    for name, (inertia, weight) in links.items():
        outer = np.outer(absolute[name], absolute[name])
        mass += inertia * outer
        stiffness += weight * outer
    return mass, damping, stiffness


def characteristic(mass, damping, stiffness):
    return np.array([np.linalg.det(mass * s**2 + damping * s + stiffness) for s in S]) / np.linalg.det(mass)


@pytest.mark.parametrize(
    ("name", "changes"),
    [
        ("paper_high_impedance", {}),
        ("paper_moving_output", LEFT_OUT | {"housing_end.gravity": 7.0}),
        ("prototype_knee", LEFT_OUT),
        ("so101_joint", {}),
        ("pendulum", {}),
        ("pendulum", {"spring_end.damping": 0.2, "spring_end.stiffness": 3.0}),
        ("pendulum", {"spring_end.gravity_angle": 0.4}),
    ],
)
def test_the_joints_hold_the_rigs_equations_of_motion(name, changes):
    rig = load_rig(name)
    rig = rig.with_values({key: value for key, value in changes.items() if key in rig.quantities or value})
    ours = mechanics(rig)
    exported = matrices(export_sdf(rig).content)
    assert exported[0].shape == ours.mass.shape
    expected = characteristic(ours.mass, ours.damping, ours.stiffness)
    np.testing.assert_allclose(characteristic(*exported), expected, rtol=1e-9)


@pytest.mark.parametrize(
    ("train", "turns"),
    [("harmonic_circular_spline_held", "-160.0"), ("harmonic_flexspline_held", "161.0"), ("star", "-159.0")],
)
def test_the_rotor_of_the_knee_turns_as_its_train_says(train, turns):
    rig = replace(load_rig("prototype_knee"), train=train)
    root = ElementTree.fromstring(export_urdf(rig).content)
    (mimic,) = root.iter("mimic")
    assert (mimic.get("joint"), mimic.get("multiplier")) == ("gear", turns)
    gear = next(joint for joint in root.iter("joint") if joint.get("name") == "gear")
    assert gear.find("axis").get("xyz") == "-1 0 0"  # from the chassis on to the housing


def test_the_block_holds_every_value():
    rig = load_rig("prototype_knee").with_effect("backlash", gap=0.003)
    block = ElementTree.fromstring(export_urdf(rig).content).find("rsea")
    assert {v.get("name"): float(v.get("value")) for v in block.findall("value")} == rig.values()
    assert block.find("effect").get("name") == "backlash"
    assert block.find("effect/parameter").get("value") == "0.003"


@pytest.mark.parametrize("export", [export_urdf, export_sdf, export_mjcf])
def test_a_linear_rig_is_refused(export):
    with pytest.raises(RigError, match="rig emps: moves along a line, expected a rotary rig"):
        export(load_rig("emps"))


def test_a_lumped_rig_is_no_mechanism():
    with pytest.raises(RigError, match="the lumped train cannot be exported"):
        export_urdf(lumped_rig(load_rig("paper_moving_output")))
