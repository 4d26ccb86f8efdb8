"""A rig as a chain of links and joints, which URDF and SDF have in common.

    housing clamped              world = housing -gear- chassis -spring- distal
    spring end clamped           world = distal -spring- chassis -gear- housing, the gear's axis turned round
    both clamped                 world = housing -gear- chassis; that joint carries the spring as well
    both free                    world -housing_end- housing -gear- chassis -spring- distal

The rotor is a link in the housing whose joint mimics the gear's with the multiplier n of train.py, so n is -N
for a harmonic drive with its circular spline held. Where the spring is rigid, chassis and distal are one. The
axis is x, level: gravity is along -z.
"""

import math
from dataclasses import dataclass, replace

from rsea_ros import Rig
from rsea_ros.extension.base import STANDARD_GRAVITY, RigError, plain
from rsea_ros.extension.target import others, rotor_inertia, train_ratio, with_structure

WORLD = "world"


@dataclass(frozen=True)
class Link:
    """A body about the axis, x. weight: m g l, N m, hanging along -z but for the angle `turned`, rad."""

    name: str
    inertia: float
    weight: float = 0.0
    turned: float = 0.0

    @property
    def mass(self) -> float:
        """Return the mass, kg: half of a pendulum's inertia is in its point mass; others are 1 kg."""
        return self.weight**2 / (0.5 * self.inertia * STANDARD_GRAVITY**2) if self.weight else 1.0

    @property
    def centre(self) -> tuple[float, float]:
        """Return where the mass is, m, y and z."""
        arm = self.weight / (self.mass * STANDARD_GRAVITY) if self.weight else 0.0
        return arm * math.sin(self.turned), 0.0 - arm * math.cos(self.turned)


@dataclass(frozen=True)
class Joint:
    """A joint about x, or -x where it is turned round. mimics: another joint, `multiplier` times."""

    name: str
    parent: str
    child: str
    damping: float = 0.0
    stiffness: float = 0.0
    is_turned: bool = False
    mimics: str = ""
    multiplier: float = 0.0


@dataclass(frozen=True)
class Chain:
    """links and joints from the world on.

    left_out: parts of the rig without a place in the chain, and why.
    """

    links: tuple[Link, ...]
    joints: tuple[Joint, ...]
    left_out: dict[str, str]


def chain_of(rig: Rig) -> Chain:
    """Return the chain of a rig. Raises RigError for a lumped train, which no mechanism is, and a linear rig.

    Of the rig's effects it has the weight of gravity_error.
    """
    others.check_rotary(rig)
    if rig.train == "lumped":
        raise RigError(f"rig {rig.name}: the lumped train cannot be exported, expected a real train")
    rig = with_structure(rig.with_effects(*(one for one in rig.effects if one.name == "gravity_error")))
    beside_gear = "spring_end" if rig.rigid_spring else "spring"
    spring = rig[f"{beside_gear}.damping"], rig[f"{beside_gear}.stiffness"]
    b_m = rig["rotor.reflected_damping"]
    moves = rig.end_is_free("housing_end"), rig.end_is_free("spring_end")
    chassis, housing = _chassis(rig), _end(rig, "housing_end", "housing")
    distal = _end(rig, "spring_end", "distal")
    links: list[Link] = []
    if not moves[0]:
        base = WORLD
        links += [chassis]
        beside = (0.0, 0.0) if moves[1] and not rig.rigid_spring else spring
        joints = [Joint("gear", base, "chassis", b_m + beside[0], beside[1])]
    elif moves[1]:
        base = "housing"
        links += [housing, chassis]
        held = rig["housing_end.damping"], rig["housing_end.stiffness"]
        joints = [Joint("housing_end", WORLD, base, *held), Joint("gear", base, "chassis", b_m)]
    else:
        base = "housing"
        links += [chassis, housing]
        joints = [
            Joint("spring", WORLD, "chassis", *spring),
            Joint("gear", "chassis", base, b_m, is_turned=True),
        ]
    if moves[1] and not rig.rigid_spring:
        links.append(distal)
        joints.append(Joint("spring", "chassis", "distal", *spring))
    links.append(Link("rotor", rotor_inertia(rig)))
    joints.append(Joint("rotor", base, "rotor", mimics="gear", multiplier=train_ratio(rig)))
    return Chain(tuple(links), tuple(joints), _omitted_elements(rig))


def _chassis(rig: Rig) -> Link:
    """Return the chassis, with the distal side where the spring is rigid."""
    is_one = rig.rigid_spring and rig.end_is_free("spring_end")
    load = _end(rig, "spring_end", "chassis") if is_one else Link("chassis", 0.0)
    inertia = rig["chassis.inertia"] + load.inertia
    if not inertia > 0.0:
        raise RigError(f"rig {rig.name}: chassis has inertia {inertia:g} kg·m², expected > 0 kg·m²")
    return replace(load, inertia=inertia)


def _end(rig: Rig, end: str, name: str) -> Link:
    if not rig.end_is_free(end):
        return Link(name, 1.0)
    fixed_to_it = rig["housing.inertia"] if end == "housing_end" else 0.0
    inertia = rig[f"{end}.inertia"] + fixed_to_it
    return Link(name, inertia, rig[f"{end}.gravity"], rig[f"{end}.gravity_angle"])


def _omitted_elements(rig: Rig) -> dict[str, str]:
    """Return the elements between parts that are not neighbours in the chain."""
    left = {}
    free = [end for end in ("housing_end", "spring_end") if rig.end_is_free(end)]
    far = free if len(free) == 1 else free[1:]
    for end in far if not (rig.rigid_spring and free == ["spring_end"]) else ():
        for name, unit in (("stiffness", "N m/rad"), ("damping", "N m s/rad")):
            if rig[f"{end}.{name}"]:
                size = f"{rig[f'{end}.{name}']:g} {plain(unit)}"
                left[f"{end}.{name}"] = f"{size} to the world, from the chain's far end"
    for part in ("gear", "proximal_spring"):
        if math.isfinite(rig[f"{part}.stiffness"]):
            left[f"{part}.stiffness"] = "a further elastic joint; the chain has it rigid"
    return left
