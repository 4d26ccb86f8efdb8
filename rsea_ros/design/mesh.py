"""Which members of a gear train mesh, in whose frame, with how many teeth: the input of a multibody engine.

Seen from the arm two gears turn about fixed centres, so that one pair of teeth is the law of the train:

    z_1 (w_1 - w_arm) = s z_2 (w_2 - w_arm),   s = +1 for internal teeth, -1 for external ones

    train                  arm                       first                second
    planetary              output (carrier)          rotor (sun)          housing (annulus), planets between
    star                   housing (carrier)         rotor (sun)          output (annulus), planets between
    harmonic, circular     rotor (wave generator)    output (flexspline)  housing (circular spline)
    harmonic, flexspline   rotor (wave generator)    housing (flexspline) output (circular spline)
    spur                   housing (bearings)        rotor (pinion)       output (wheel)

How often the rotor turns follows from bodies borne in each other; model/train.py has it as a formula, which
this file does not use. Teeth need not be whole numbers here: only their ratio counts.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from rsea_ros.errors import RigError
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
    ratio = rig["gear.ratio"]
    match rig.train:
        case "planetary":
            return Mesh("output", ("rotor", "housing"), (1.0, ratio - 1.0), internal=False)
        case "star":
            return Mesh("housing", ("rotor", "output"), (1.0, ratio - 1.0), internal=False)
        case "harmonic_circular_spline_held":
            return Mesh("rotor", ("output", "housing"), (2.0 * ratio, 2.0 * ratio + 2.0), internal=True)
        case "harmonic_flexspline_held":
            return Mesh("rotor", ("housing", "output"), (2.0 * ratio, 2.0 * ratio + 2.0), internal=True)
        case "spur":
            return Mesh("housing", ("rotor", "output"), (1.0, ratio), internal=False)
        case _:
            raise RigError(f"rig {rig.name}: the lumped train cannot be exported, expected a real train")
