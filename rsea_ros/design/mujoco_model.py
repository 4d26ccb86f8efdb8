"""A rig as MJCF, the XML of the multibody engine MuJoCo, for a second opinion from other code.

Housing and loads have their own hinges about the actuator's axis (z); gear output and rotor are borne where
the mechanism bears them: a planetary train's rotor in the carrier, a harmonic drive's flexspline on
its wave generator. So a hinge's angle is that against the bearing part, the engine composes the rotor's spin
from the bodies by itself, and the train is one equality between two hinges, two gears in mesh:
z_1 q_1 = s z_2 q_2. Seen from the arm two gears turn about fixed centres, so that one pair of teeth is the
law of the train:

    z_1 (w_1 - w_arm) = s z_2 (w_2 - w_arm),   s = +1 for internal teeth, -1 for external ones

    train                  arm                       first                second
    planetary              output (carrier)          rotor (sun)          housing (annulus), planets between
    star                   housing (carrier)         rotor (sun)          output (annulus), planets between
    harmonic, circular     rotor (wave generator)    output (flexspline)  housing (circular spline)
    harmonic, flexspline   rotor (wave generator)    housing (flexspline) output (circular spline)
    spur                   housing (bearings)        rotor (pinion)       output (wheel)

How often the rotor turns follows from bodies borne in each other; model/train.py has it as a formula, which
this file does not use. Teeth need not be whole numbers here: only their ratio counts.

    spring       q_c - q_d, stiffness and damping       motor    q_c - q_h, driven and damped
    gear         where it gives: chassis and rotor in the housing, a spring from chassis to the mesh's output

    play         where it has some: chassis and rotor in the housing too, a limit from chassis to that output

Sums of hinges (fixed tendons) run along the bodies' chain. A clamped end has no hinge. A pendulum (m g l)
hangs along -y, half its inertia in a point mass; other masses are 1 kg on the axis, where they do nothing.
The rig's effects are left out; exports/mjcf.py adds them.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal
from xml.etree import ElementTree as xml

from rsea_ros.documents.units import STANDARD_GRAVITY
from rsea_ros.documents.wording import printable
from rsea_ros.errors import RigError
from rsea_ros.model.equations import rotor_inertia
from rsea_ros.model.rig import Rig

Member = Literal["housing", "rotor", "output"]


@dataclass(frozen=True)
class Mesh:
    """arm: the frame of the two centres. gears: the members that mesh. teeth: of each. internal: s = +1."""

    arm: Member
    gears: tuple[Member, Member]
    teeth: tuple[float, float]
    internal: bool

    @property
    def sense(self) -> float:
        """Return s: +1 where both gears turn the same way as seen from the arm."""
        return 1.0 if self.internal else -1.0

    def law(self) -> dict[Member, float]:
        """Return the factors of the members' absolute angles whose sum is zero."""
        first, second = self.teeth[0], -self.sense * self.teeth[1]
        return {self.gears[0]: first, self.gears[1]: second, self.arm: -(first + second)}


def mesh_of(rig: Rig) -> Mesh:
    """Return the mesh of a rig's train. Raises RigError for a lumped one, which no mechanism is."""
    if rig.beside_spring != "chassis":
        what = f"rig {rig.name}: beside_spring = {rig.beside_spring}"
        raise RigError(f"{what} cannot be exported, expected chassis", "beside_spring")
    ratio = rig["gear.ratio"]
    splines, planets = (2.0 * ratio, 2.0 * ratio + 2.0), (1.0, ratio - 1.0)
    meshes = {
        "planetary": Mesh("output", ("rotor", "housing"), planets, internal=False),
        "star": Mesh("housing", ("rotor", "output"), planets, internal=False),
        "harmonic_circular_spline_held": Mesh("rotor", ("output", "housing"), splines, internal=True),
        "harmonic_flexspline_held": Mesh("rotor", ("housing", "output"), splines, internal=True),
        "spur": Mesh("housing", ("rotor", "output"), (1.0, ratio), internal=False),
    }
    if rig.train not in meshes:
        raise RigError(f"rig {rig.name}: the lumped train cannot be exported, expected a real train")
    return meshes[rig.train]


STEP = 5e-5
"""s, fixed step of the engine."""
SOLREF, SOLIMP = f"{2.0 * STEP:g} 1", "0.9999 0.9999 0.001"
"""Equalities are soft in MuJoCo; this is as stiff as the step allows."""
SENSED = {
    "motor": "output",
    "encoder": "output",
    "spring": "deflection",
    "proximal_spring": "proximal",
    "play": "play",
}
"""Sums of hinges whose angle and speed have sensors, and the sensors' names."""
_LENGTH = {"housing_end": 0.4, "spring_end": -0.4}
"""m, of the drawn links: thigh up, shank down."""


def text(root: xml.Element) -> str:
    """Return a model as the text of its file."""
    xml.indent(root)
    return printable(xml.tostring(root, encoding="unicode")) + "\n"


def model_element(rig: Rig, play: float = 0.0) -> xml.Element:
    """Return the model as XML. play: whole width between gear output and chassis, rad.

    Raises RigError for a rig that is lumped, has a rigid spring or a massless part.
    """
    if rig.rigid_spring:
        raise RigError(f"rig {rig.name}: a rigid spring cannot be exported, expected a spring")
    mesh = mesh_of(rig)
    root = xml.Element("mujoco", model=rig.name)
    xml.SubElement(root, "compiler", angle="radian")
    gravity = f"0 {-STANDARD_GRAVITY} 0"
    xml.SubElement(root, "option", timestep=f"{STEP:g}", integrator="RK4", gravity=gravity, tolerance="1e-12")
    is_stiff = math.isinf(rig["gear.stiffness"]) and not play
    parents = _bodies(rig, mesh, xml.SubElement(root, "worldbody"), is_stiff)
    _join(rig, mesh, parents, root, play)
    sensors = xml.SubElement(root, "sensor")
    tendons = {one.get("name", "") for one in root.iter("fixed")}
    for tendon, name in SENSED.items():
        if tendon in tendons and not (tendon == "motor" and "encoder" in tendons):
            xml.SubElement(sensors, "tendonpos", name=name, tendon=tendon)
            xml.SubElement(sensors, "tendonvel", name=f"{name}_rate", tendon=tendon)
    return root


def _bodies(rig: Rig, mesh: Mesh, world: xml.Element, is_stiff: bool) -> Mapping[str, str | None]:
    """Add the parts; return in which part each is borne, None for the world."""
    elastic = math.isfinite(rig["proximal_spring.stiffness"])
    moves = elastic or rig.end_is_free("housing_end")
    housing = world
    if elastic:
        housing = _body(world, "housing", rig["housing.inertia"])
    if rig.end_is_free("housing_end"):
        fixed_to_it = 0.0 if elastic else rig["housing.inertia"]
        load = _end(rig, world, "housing_end", "proximal" if elastic else "housing", fixed_to_it)
        housing = housing if elastic else load
    else:
        _link(world, "housing_end")
    parents = _borne(mesh, "housing" if moves else None, is_stiff)
    bodies = {"housing": housing}
    inertia = {"rotor": rotor_inertia(rig), "chassis": rig["chassis.inertia"]}
    for name in sorted(inertia, key=lambda part: parents[part] in inertia):  # those in the housing first
        bodies[name] = _body(bodies[parents[name] or "housing"], name, inertia[name])
    if rig.end_is_free("spring_end"):
        _end(rig, world, "spring_end", "distal", 0.0)
    else:
        _link(world, "spring_end")
    return parents


def _borne(mesh: Mesh, housing: str | None, is_stiff: bool) -> dict[str, str | None]:
    """Return where rotor and chassis are borne: in the housing, or one of them in the other, the arm."""
    parents: dict[str, str | None] = {"rotor": housing, "chassis": housing}
    if is_stiff and mesh.arm != "housing":
        arm, other = ("rotor", "chassis") if mesh.arm == "rotor" else ("chassis", "rotor")
        parents[other] = arm
    return parents


def _end(rig: Rig, world: xml.Element, end: str, name: str, fixed_to_it: float) -> xml.Element:
    """Add and return the load of an end; fixed_to_it: inertia of the part that it is fixed to, kg m^2."""
    inertia, weight = rig[f"{end}.inertia"] + fixed_to_it, rig[f"{end}.gravity"]
    body = _body(world, name, inertia, weight, rig[f"{end}.gravity_angle"])
    joint = body.find("joint")
    assert joint is not None
    joint.set("stiffness", repr(rig[f"{end}.stiffness"]))
    joint.set("damping", repr(rig[f"{end}.damping"]))
    _link(body, end)
    return body


def _body(
    world: xml.Element, name: str, inertia: float, weight: float = 0.0, turned: float = 0.0
) -> xml.Element:
    """Add a body with a hinge. Raises RigError for one without inertia.

    weight: m g l, N m. turned: how far from hanging it is at angle zero, rad.
    """
    if not inertia > 0.0:
        raise RigError(f"mjcf: {name} has inertia {inertia:g} kg·m², expected a value > 0 kg·m²")
    arm = 0.5 * inertia * STANDARD_GRAVITY / weight if weight else 0.0
    mass = weight / (STANDARD_GRAVITY * arm) if weight else 1.0
    about_mass = inertia - mass * arm**2
    body = xml.SubElement(world, "body", name=name)
    xml.SubElement(body, "joint", name=name, type="hinge", axis="0 0 1")
    diagonal = " ".join([repr(about_mass)] * 3)
    place = f"{arm * math.sin(turned)!r} {0.0 - arm * math.cos(turned)!r} 0"
    xml.SubElement(body, "inertial", pos=place, mass=repr(mass), diaginertia=diagonal)
    return body


def _link(parent: xml.Element, end: str) -> None:
    """Add a capsule to look at: no mass, no contact."""
    reach = f"0 0 0 0 {_LENGTH[end]} 0"
    xml.SubElement(
        parent, "geom", type="capsule", fromto=reach, size="0.03", mass="0", contype="0", conaffinity="0"
    )


def _join(
    rig: Rig, mesh: Mesh, parents: Mapping[str, str | None], root: xml.Element, play: float
) -> None:
    """Add springs, dampers, the train and the motor."""
    tendons = xml.SubElement(root, "tendon")
    damping, stiff = rig["rotor.reflected_damping"], math.isinf(rig["gear.stiffness"]) and not play

    def tie(
        name: str, angles: Mapping[str, float], stiffness: float = 0.0, damping: float = 0.0
    ) -> xml.Element:
        return _tendon(root, tendons, name, _hinges(angles, parents), stiffness, damping)

    tie("spring", {"chassis": 1.0, "distal": -1.0}, *_spring(rig, "spring"))
    output = {"chassis": 1.0} if stiff else _output(mesh)
    tie("motor", _sum(output, {"housing": -1.0}), 0.0, damping)
    if stiff:
        _teeth(root, tendons, mesh)
    elif play:
        flanks = tie("play", _sum(output, {"chassis": -1.0}))
        limits = {"solreflimit": SOLREF, "solimplimit": SOLIMP}
        flanks.attrib |= {"range": f"{-0.5 * play!r} {0.5 * play!r}", "limited": "true", **limits}
    else:
        tie("gear", _sum(output, {"chassis": -1.0}), *_spring(rig, "gear"))
        tie("encoder", {"chassis": 1.0, "housing": -1.0})
    if math.isfinite(rig["proximal_spring.stiffness"]):
        tie("proximal_spring", {"proximal": 1.0, "housing": -1.0}, *_spring(rig, "proximal_spring"))
    actuators = xml.SubElement(root, "actuator")
    xml.SubElement(actuators, "motor", name="motor", tendon="motor", gear="1")


def _teeth(root: xml.Element, tendons: xml.Element, mesh: Mesh) -> None:
    """Tie the hinges of the two gears, each its angle as seen from the arm: z_1 q_1 - s z_2 q_2 = 0.

    A gear borne in the arm turns by its hinge; the housing, in which the arm is borne, by minus the arm's. (A
    tendon, for the engine makes an equality of two joints much softer where one carries the other.)
    """
    part, factors = {"rotor": "rotor", "output": "chassis"}, (mesh.teeth[0], -mesh.sense * mesh.teeth[1])
    hinges = {
        part.get(gear, part.get(mesh.arm, "")): factor if gear in part else -factor
        for gear, factor in zip(mesh.gears, factors, strict=True)
    }
    _tendon(root, tendons, "teeth", hinges)
    equality = xml.SubElement(root, "equality")
    xml.SubElement(equality, "tendon", tendon1="teeth", polycoef="0 0 0 0 0", solref=SOLREF, solimp=SOLIMP)


def _output(mesh: Mesh) -> dict[str, float]:
    """Return the mesh's output, a part without mass, as a sum of rotor's and housing's absolute angles."""
    law = mesh.law()
    return {name: -law[name] / law["output"] for name in ("rotor", "housing")}


def _sum(*angles: Mapping[str, float]) -> dict[str, float]:
    names = {name for part in angles for name in part}
    return {name: sum(part.get(name, 0.0) for part in angles) for name in sorted(names)}


def _hinges(angles: Mapping[str, float], parents: Mapping[str, str | None]) -> dict[str, float]:
    """Return a sum of absolute angles as a sum of hinges along each part's chain of bearings."""
    hinges: dict[str, float] = {}
    for name, factor in angles.items():
        part: str | None = name
        while part is not None:
            hinges[part] = hinges.get(part, 0.0) + factor
            part = parents.get(part)
    return hinges


def _spring(rig: Rig, name: str) -> tuple[float, float]:
    return rig[f"{name}.stiffness"], rig[f"{name}.damping"]


def _tendon(
    root: xml.Element,
    tendons: xml.Element,
    name: str,
    angles: Mapping[str, float],
    stiffness: float = 0.0,
    damping: float = 0.0,
) -> xml.Element:
    """Add and return a sum of hinge angles; those of clamped parts are left out."""
    moving = {joint.get("name") for joint in root.iter("joint")}
    fixed = xml.SubElement(tendons, "fixed", name=name, stiffness=repr(stiffness), damping=repr(damping))
    for joint, coefficient in angles.items():
        if joint in moving and coefficient:
            xml.SubElement(fixed, "joint", joint=joint, coef=repr(coefficient))
    return fixed
