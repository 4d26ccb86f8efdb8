"""The kinds of gear train, and how often the rotor turns for one turn of the gear output.

    train                           housing            rotor            gear output       n
    planetary                       annulus            sun              carrier           N
    star                            carrier            sun              annulus           -(N - 1)
    harmonic_circular_spline_held   circular spline    wave generator   flexspline        -N
    harmonic_flexspline_held        flexspline         wave generator   circular spline   N + 1
    spur                            bearings of both   pinion           wheel             -N
    lumped                          (rotor turns against the ground)                      N

n counts both turns against the housing; N is `gear.ratio`. The sign matters: n J_r adds to the chassis or
takes from it (transfer.py). Sources: Willis' equation for the first two; for a harmonic drive the maker's
ratio R = z_f / (z_c - z_f) with z_f, z_c teeth of flexspline and circular spline (Harmonic Drive catalogues,
"rotational direction and reduction ratio"). test/model/test_train.py derives every n from rolling contacts.
"""

from typing import Literal, get_args

Train = Literal[
    "planetary", "star", "harmonic_circular_spline_held", "harmonic_flexspline_held", "spur", "lumped"
]
TRAINS: tuple[Train, ...] = get_args(Train)


def rotor_turns(train: Train, ratio: float) -> float:
    """Return n for a train with this `gear.ratio` N."""
    match train:
        case "star":
            return 1.0 - ratio
        case "harmonic_flexspline_held":
            return ratio + 1.0
        case "harmonic_circular_spline_held" | "spur":
            return -ratio
        case _:
            return ratio


def spin_inertia(train: Train, ratio: float, reflected: float) -> float:
    """Return the rotor's share of the inertia between the two ends, kg m^2: n J_r with J_r = J_m / N^2.

    reflected: J_m, kg m^2. Negative where the rotor turns against the output; J_m itself for a lumped rotor.
    """
    return reflected if train == "lumped" else rotor_turns(train, ratio) * reflected / ratio**2
