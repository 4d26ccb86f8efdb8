"""Rigs of every structure with random values, for property tests."""

import math

from hypothesis import strategies as st

from rsea_ros.model.rig import END_NAMES, Quantity, Rig
from rsea_ros.model.train import TRAINS

RIG_NAMES = ("paper_high_impedance", "paper_moving_output", "prototype_knee", "bare_drive", "pendulum")
WITH_SPRING = RIG_NAMES[:3]

RANGES = {
    "rotor.reflected_inertia": (0.01, 2.0),
    "rotor.reflected_damping": (0.1, 30.0),
    "gear.ratio": (2.0, 500.0),
    "chassis.inertia": (1e-3, 5e-2),
}
SPRING = {"spring.stiffness": (50.0, 3000.0), "spring.damping": (0.02, 5.0)}
GEAR = {"gear.stiffness": (2e3, 5e4), "gear.damping": (0.02, 5.0)}
PROXIMAL = {
    "proximal_spring.stiffness": (200.0, 5e4),
    "proximal_spring.damping": (0.02, 5.0),
    "housing.inertia": (0.01, 0.5),
}
END = {"inertia": (0.02, 1.0), "damping": (0.05, 1.0), "stiffness": (0.1, 20.0), "gravity": (0.1, 5.0)}


def _between(bounds):
    low, high = (math.log10(b) for b in bounds)
    return st.floats(low, high).map(lambda exponent: 10.0**exponent)


@st.composite
def rigs(draw, *, gravity=False):
    """Draw a rig without effects: ends clamped or free, spring rigid or not, gear stiff or
    not, a spring on the proximal side or not, any real train.

    gravity: let ends be pendulums, whose equations of motion are not linear.
    """
    clamped = frozenset(end for end in END_NAMES if draw(st.booleans()))
    compliant_gear = draw(st.booleans())
    proximal = draw(st.sampled_from([False, False, True]))
    rigid = draw(st.booleans()) and (compliant_gear or "spring_end" not in clamped)
    ranges = RANGES | ({} if rigid else SPRING) | (GEAR if compliant_gear else {})
    ranges |= PROXIMAL if proximal else {}
    for end in sorted(set(END_NAMES) - clamped):
        keys = ["inertia", "damping"] + [k for k in ("stiffness", "gravity") if draw(st.booleans())]
        ranges |= {f"{end}.{k}": END[k] for k in keys if gravity or k != "gravity"}
    return Rig(
        name="random",
        quantities={name: Quantity(draw(_between(bounds))) for name, bounds in ranges.items()},
        clamped=clamped,
        rigid_spring=rigid,
        train=draw(st.sampled_from([t for t in TRAINS if t != "lumped"])),
        proximal=draw(st.sampled_from(END_NAMES)),
        ft_end=draw(st.sampled_from(END_NAMES)) if proximal and not rigid else "spring_end",
    )
