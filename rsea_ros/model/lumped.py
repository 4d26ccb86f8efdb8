"""The traditional lumped model of a rig, which the paper argues against.

The reflected rotor inertia is taken for an inertia of the chassis against the ground, J_eff = J_sc + J_m,
and the motor for a torque between ground and chassis: the housing's motion is left out. With both ends
clamped this changes T_p, Eqs. (2) and (3), and nothing in T_d, Eq. (1).

A rig with `train: lumped` and a free housing grounds the rotor only; its loads move. Fig. 18 can be read
either way (paper/figure_18.py).
"""

from dataclasses import replace

from rsea_ros.model.rig import Rig


def lumped_rig(rig: Rig) -> Rig:
    """Return the rig of the lumped model; every function of the model accepts it."""
    return replace(rig, name=f"{rig.name}, lumped", train="lumped", clamped=rig.clamped | {"housing_end"})
