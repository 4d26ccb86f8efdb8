"""A rig as MJCF, the XML of the multibody engine MuJoCo, for a second opinion from other code.

Every part is a body with its own hinge about the actuator's axis (z), so that the engine knows nothing of our
coordinates; what joins them are fixed tendons, each a sum of joint angles:

    spring       q_c - q_d, stiffness and damping     motor    q_c - q_h, driven and damped
    train        q_r - (1 - n) q_h - n q_g = 0, an equality, where the gear is stiff (q_g = q_c)
    gear         q_r / n - (1 - n) / n q_h - q_c, a spring, where it gives

A clamped end has no hinge. A pendulum (m g l) hangs along -y, half its inertia in a point mass; other masses
are 1 kg on the axis, where they do nothing. The rig's effects are left out.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from xml.etree import ElementTree as xml

from rsea_ros.errors import RigError
from rsea_ros.model.equations import rotor_inertia, train_ratio
from rsea_ros.model.rig import Rig

GRAVITY = 9.80665
STEP = 5e-5
"""s, fixed step of the engine."""
SOLREF, SOLIMP = f"{2.0 * STEP:g} 1", "0.9999 0.9999 0.001"
"""Equalities are soft in MuJoCo; this is as stiff as the step allows."""
_LENGTH = {"housing_end": 0.4, "spring_end": -0.4}
"""m, of the drawn links: thigh up, shank down."""


def mjcf(rig: Rig) -> str:
    """Return the model. Raises RigError for a rig that is lumped, has a rigid spring or a massless part."""
    if rig.rigid_spring or rig.train == "lumped":
        kind = "a rigid spring" if rig.rigid_spring else "the lumped train"
        raise RigError(f"rig {rig.name}: {kind} cannot be exported, expected a spring and a real train")
    root = xml.Element("mujoco", model=rig.name)
    xml.SubElement(root, "compiler", angle="radian")
    xml.SubElement(
        root, "option", timestep=f"{STEP:g}", integrator="RK4", gravity=f"0 {-GRAVITY} 0", tolerance="1e-12"
    )
    _bodies(rig, xml.SubElement(root, "worldbody"))
    _joined(rig, root)
    xml.indent(root)
    return xml.tostring(root, encoding="unicode") + "\n"


def _bodies(rig: Rig, world: xml.Element) -> None:
    elastic = math.isfinite(rig["proximal_spring.stiffness"])
    if elastic:
        _body(world, "housing", rig["housing.inertia"])
    if rig.end_is_free("housing_end"):
        own = 0.0 if elastic else rig["housing.inertia"]
        _end(rig, world, "housing_end", "proximal" if elastic else "housing", own)
    else:
        _link(world, "housing_end")
    _body(world, "rotor", rotor_inertia(rig))
    _body(world, "chassis", rig["chassis.inertia"])
    if rig.end_is_free("spring_end"):
        _end(rig, world, "spring_end", "distal", 0.0)
    else:
        _link(world, "spring_end")


def _end(rig: Rig, world: xml.Element, end: str, name: str, own: float) -> None:
    """Add the load of an end; own: inertia of the part that it is fixed to, kg m^2."""
    inertia, weight = rig[f"{end}.inertia"] + own, rig[f"{end}.gravity"]
    body = _body(world, name, inertia, weight)
    joint = body.find("joint")
    assert joint is not None
    joint.set("stiffness", repr(rig[f"{end}.stiffness"]))
    joint.set("damping", repr(rig[f"{end}.damping"]))
    _link(body, end)


def _body(world: xml.Element, name: str, inertia: float, weight: float = 0.0) -> xml.Element:
    """Add a body with a hinge. weight: m g l, N m. Raises RigError for one without inertia."""
    if not inertia > 0.0:
        raise RigError(f"mjcf: {name} has inertia {inertia:g} kg m^2, expected a value > 0 kg m^2")
    arm = 0.5 * inertia * GRAVITY / weight if weight else 0.0
    mass = weight / (GRAVITY * arm) if weight else 1.0
    about_mass = inertia - mass * arm**2
    body = xml.SubElement(world, "body", name=name)
    xml.SubElement(body, "joint", name=name, type="hinge", axis="0 0 1")
    diagonal = " ".join([repr(about_mass)] * 3)
    xml.SubElement(body, "inertial", pos=f"0 {0.0 - arm!r} 0", mass=repr(mass), diaginertia=diagonal)
    return body


def _link(parent: xml.Element, end: str) -> None:
    """Add a capsule to look at: no mass, no contact."""
    reach = f"0 0 0 0 {_LENGTH[end]} 0"
    xml.SubElement(
        parent, "geom", type="capsule", fromto=reach, size="0.03", mass="0", contype="0", conaffinity="0"
    )


def _joined(rig: Rig, root: xml.Element) -> None:
    """Add springs, dampers, the train and the motor."""
    n, tendons = train_ratio(rig), xml.SubElement(root, "tendon")
    damping = rig["rotor.reflected_damping"]
    _tendon(root, tendons, "spring", {"chassis": 1.0, "distal": -1.0}, *_spring(rig, "spring"))
    if math.isinf(rig["gear.stiffness"]):
        _tendon(root, tendons, "motor", {"chassis": 1.0, "housing": -1.0}, 0.0, damping)
        _tendon(root, tendons, "train", {"rotor": 1.0, "housing": n - 1.0, "chassis": -n})
        equality = xml.SubElement(root, "equality")
        xml.SubElement(
            equality, "tendon", tendon1="train", polycoef="0 0 0 0 0", solref=SOLREF, solimp=SOLIMP
        )
    else:
        _tendon(root, tendons, "motor", {"rotor": 1.0 / n, "housing": -1.0 / n}, 0.0, damping)
        output = {"rotor": 1.0 / n, "housing": 1.0 - 1.0 / n}
        _tendon(root, tendons, "gear", {**output, "chassis": -1.0}, rig["gear.stiffness"])
    if math.isfinite(rig["proximal_spring.stiffness"]):
        sides = {"proximal": 1.0, "housing": -1.0}
        _tendon(root, tendons, "proximal_spring", sides, *_spring(rig, "proximal_spring"))
    actuators = xml.SubElement(root, "actuator")
    xml.SubElement(actuators, "motor", name="motor", tendon="motor", gear="1")


def _spring(rig: Rig, name: str) -> tuple[float, float]:
    return rig[f"{name}.stiffness"], rig[f"{name}.damping"]


def _tendon(
    root: xml.Element,
    tendons: xml.Element,
    name: str,
    angles: Mapping[str, float],
    stiffness: float = 0.0,
    damping: float = 0.0,
) -> None:
    """Add a sum of joint angles; those of clamped parts are left out."""
    moving = {joint.get("name") for joint in root.iter("joint")}
    fixed = xml.SubElement(tendons, "fixed", name=name, stiffness=repr(stiffness), damping=repr(damping))
    for joint, coefficient in angles.items():
        if joint in moving:
            xml.SubElement(fixed, "joint", joint=joint, coef=repr(coefficient))
