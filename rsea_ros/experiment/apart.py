"""The measurement apart that separates two hypotheses where no run does."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from rsea_ros.effects.catalogue import effect_named
from rsea_ros.effects.signal_table import Port
from rsea_ros.experiment.bound import HOPELESS, Bound
from rsea_ros.experiment.containment import NOTHING
from rsea_ros.experiment.hypothesis import Hypothesis

ACCURACY = 0.01
"""Relative, one sigma: what a value measured apart with care is worth."""
MOST = 2
_OF_VALUES: Mapping[str, str] = {
    "spring.stiffness": "the stiffness of the spring, by a known weight on a lever and the encoder",
    "rotor.reflected_inertia": "the inertia of the rotor, from its drawing or by a pendulum",
    "rotor.reflected_damping": "the drag of the motor, by its no-load current at a few speeds",
    "spring.damping": "the damping of the spring, by a free swing",
}
_OF_PORTS: Mapping[Port, str] = {
    Port.COMMAND: "the torque that the motor makes, by a torque sensor between motor and spring",
    Port.MOTOR: "the torque that the motor makes, by a torque sensor or a known weight held at rest",
    Port.GEAR: "the angle behind the gear, by a second encoder",
    Port.SPRING: "the deflection of the spring, by a second encoder",
    Port.SENSOR: "the F/T sensor, calibrated with a known weight",
    Port.STRUCTURE: "the motion of what gives, by an accelerometer or a dial gauge",
}


@dataclass(frozen=True)
class Apart:
    """A measurement apart. separation: S that it brings, None where that was not computed."""

    what: str
    separation: float | None = None


def measurements_apart(proved: Bound, true: Hypothesis, rival: Hypothesis) -> list[Apart]:
    """Return separate measurements: the sensors that show the causes, then at most MOST values of the rig.

    A value of the rig separates by how far the rival must have it from the true one to do what that does,
    over ACCURACY; of those that separate, the easiest to measure come first.
    """
    ours = {u.name: u.outer(float(v)) for u, v in zip(true.problem.unknowns, true.if_there(), strict=True)}
    values = []
    for name, theirs in proved.values.items():
        if name in true.problem.rig.quantities and ours[name] > 0.0 and theirs > 0.0:
            away = np.log(theirs / ours[name]) / ACCURACY
            values.append(Apart(_OF_VALUES.get(name, f"{name}, by itself"), float(away**2)))
    easy = [*_OF_VALUES.values()]
    values = [v for v in values if (v.separation or 0.0) > HOPELESS]
    values.sort(key=lambda v: easy.index(v.what) if v.what in easy else len(easy))
    effects = [effect_named(h.name) for h in (true, rival) if h.name != NOTHING]
    sensors = dict.fromkeys(_OF_PORTS[e.port] for e in effects)
    return [*(Apart(what) for what in sensors), *values[:MOST]]
