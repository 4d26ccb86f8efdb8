"""The kinds of gear train, and how often the rotor turns for one turn of the gear output.

    train                           housing            rotor            gear output       n
    planetary                       annulus            sun              carrier           N
    star                            carrier            sun              annulus           -(N - 1)
    harmonic_circular_spline_held   circular spline    wave generator   flexspline        -N
    harmonic_flexspline_held        flexspline         wave generator   circular spline   N + 1
    spur                            bearings of both   pinion           wheel             -N
    lumped                          (rotor turns against the ground)                      N

n counts both turns against the housing; N is `gear.ratio`. Held by the gear output instead, with the motor's
housing beside the spring (RT-RSEA), the rotor turns 1 - n times for one turn of the housing, both against the
output: the same equations with another n. The sign matters: n J_r adds to the chassis or
takes from it (transfer.py). Sources: Willis' equation for the first two; for a harmonic drive the maker's
ratio R = z_f / (z_c - z_f) with z_f, z_c teeth of flexspline and circular spline (Harmonic Drive catalogues,
"rotational direction and reduction ratio"). test/model/test_train.py derives every n from rolling contacts.
"""

from typing import Literal, get_args

Train = Literal[
    "planetary", "star", "harmonic_circular_spline_held", "harmonic_flexspline_held", "spur", "lumped"
]
TRAINS: tuple[Train, ...] = get_args(Train)
Part = Literal["chassis", "housing"]
"""Beside the spring: the chassis on the gear output (T-RSEA), or the motor's housing (RT-RSEA)."""
PARTS: tuple[Part, ...] = get_args(Part)


def rotor_turns(train: Train, ratio: float, beside_spring: Part = "chassis") -> float:
    """Return n for a train with this `gear.ratio` N: turns for one of the part beside the spring."""
    n = {"star": 1.0 - ratio, "harmonic_flexspline_held": ratio + 1.0,
         "harmonic_circular_spline_held": -ratio, "spur": -ratio}.get(train, ratio)  # fmt: skip
    return n if beside_spring == "chassis" or train == "lumped" else 1.0 - n


def spin_inertia(train: Train, ratio: float, reflected: float, beside_spring: Part = "chassis") -> float:
    """Return the rotor's share of the inertia between the two ends, kg m^2: n J_r with J_r = J_m / N^2.

    reflected: J_m, kg m^2. Negative where the rotor turns against the part beside the spring; J_m itself for
    a lumped rotor.
    """
    if train == "lumped":
        return reflected
    return rotor_turns(train, ratio, beside_spring) * reflected / ratio**2
