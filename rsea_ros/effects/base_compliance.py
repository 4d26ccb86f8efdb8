"""Compliant base: the clamped end of the spring is a mass on a stiff spring.

    inertia · q̈ + 2 · damping_ratio · √(stiffness · inertia) · q̇ + stiffness · q = T_s,
    T_ft = T_s - above_sensor · inertia · q̈

q is the angle of the base. The F/T sensor sits between it and the spring, or with above_sensor = 1 under it;
between, it bears a share of the base's inertia.

Source: Ewins, Modal Testing, 2000, section 2.4 (a mode excited by a force).
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from rsea_ros.effects.effect import Claims, Effect, Parameter
from rsea_ros.effects.guess import STIFFNESS, Guess, ResidualView
from rsea_ros.effects.signal_table import Port
from rsea_ros.errors import ParameterError


def change(rig: Any, parameters: Mapping[str, float]) -> Any:
    """Return the rig with its spring end on the base. Raises ParameterError when that end is free already."""
    stiffness, inertia = parameters["stiffness"], parameters["inertia"]
    if math.isinf(stiffness):
        return rig
    if "spring_end" not in rig.clamped:
        raise ParameterError(f"effect base_compliance: rig {rig.name}: spring_end is free, expected clamped")
    values = {
        "spring_end.inertia": inertia,
        "spring_end.stiffness": stiffness,
        "spring_end.damping": 2.0 * parameters["damping_ratio"] * math.sqrt(stiffness * inertia),
        "spring_end.above_sensor": parameters["above_sensor"],
    }
    return replace(rig.with_values(values), clamped=rig.clamped - {"spring_end"})


_STIFFER = (4.0, 9.0, 20.0)
"""Stiffness of the base over that of the spring: a stiffer one hardly shows."""


def guesses(defaults: Sequence[Guess], view: ResidualView) -> list[Guess]:
    """Begin with the base's mode at the highest peak of each channel.

    The rig's spring is stiffer then: the fit without the effect sees both in series. A mode above all that
    the command excites makes no peak, so the default inertias are tried as well.
    """
    if view.rigid_spring:
        return list(defaults)
    channels = sorted(set(view.channels) & view.measured - {"motor_torque"})
    modes = {round(4.0 * math.log2(f)): f for n in channels for f in view.lines(n, is_sharp=False)[:1]}
    k = view.value(STIFFNESS)
    series = [(ratio * k, k / (1.0 - 1.0 / ratio)) for ratio in _STIFFER]
    bases = [(b, s, (b + s) / (2.0 * math.pi * f) ** 2) for f in modes.values() for b, s in series]
    bases += [(*series[0], inertia) for inertia in sorted({guess["inertia"] for guess in defaults})]
    return [{**defaults[0], "stiffness": b, STIFFNESS: s, "inertia": inertia} for b, s, inertia in bases]


EFFECT = Effect(
    name="base_compliance",
    port=Port.STRUCTURE,
    parameters=(
        Parameter(
            "stiffness", "N m/rad", null=math.inf, low=2e3, high=1e7, typical=3e4, starts=(8e3, 2e5),
            logarithmic=True,
            reason="softer than the spring, it would be the spring; thousands of times stiffer, it does "
            "not show",
        ),
        Parameter(
            "inertia", "kg m^2", null=0.5, low=1e-3, high=10.0, typical=0.5, starts=(0.05, 3.0),
            logarithmic=True,
            reason="a thousandth of the rotor's to ten times it: a heavier one is `structural_resonance`",
        ),
        Parameter(
            "damping_ratio", "1", null=0.02, low=1e-3, high=1.0, typical=0.02, logarithmic=True,
            optional=True,
            reason="0.001 to 0.1 for metal structures (Ewins); 1: no overshoot",
        ),
        Parameter(
            "above_sensor", "1", null=0.0, low=0.0, high=1.0, typical=0.0, optional=True, shapes=True,
            reason="a share",
        ),
    ),
    claims=Claims(
        "position", "odd", amplitude_exponent=1.0, passive=True, confusable_with=("structural_resonance",)
    ),
    structure=change,
    guesses=guesses,
    tags=("mode",),
    part="support",
    about="the clamped end of the spring gives",
    inspect="the bolts of the clamped end, the table or profile it stands on, an adapter plate that bends",
)
