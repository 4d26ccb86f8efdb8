"""Controllers of the literature, each in about ten lines: what the users' first experiments are played with.

All measure ft and velocity at the samples and command one sample later, as the project's does. None knows a
load.

none               u = r
pratt_williamson   inverse of the locked actuator on r, PD on the torque error (Pratt, Williamson, Series
                   elastic actuators, IEEE/RSJ IROS 1995)
paine              PD with feed-forward, and a disturbance observer on the closed loop's torque (Paine, Oh,
                   Sentis, IEEE/ASME Trans. Mechatronics 19, 2014)
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from rsea_ros.control.controller import Measurement, TorqueController
from rsea_ros.control.law import Gains
from rsea_ros.model.rig import Rig

Step = Callable[[float, float, float], float]
"""(ft, velocity, desired) -> command."""
Values = Sequence[float]


@dataclass
class Filter:
    """A low pass of second order, w^2 / (s + w)^2, with the rate and the second rate of what goes through."""

    hz: float
    h: float
    y: float = 0.0
    rate: float = 0.0
    second: float = 0.0

    def __call__(self, x: float) -> float:
        w = 2.0 * math.pi * self.hz
        self.second = (w * w * (x - self.y) - 2.0 * w * self.rate) / (1.0 + w * self.h) ** 2
        self.rate += self.h * self.second
        self.y += self.h * self.rate
        return self.y


def none(rig: Rig, h: float, x: Values) -> Step:
    """Return r itself."""
    return lambda ft, velocity, r: r


def inverse(rig: Rig, q: Filter) -> float:
    """Return Q (J s^2 + b s + K) / K of the signal that went through Q."""
    j, b, k = rig["rotor.reflected_inertia"], rig["rotor.reflected_damping"], rig["spring.stiffness"]
    return q.y + (b * q.rate + j * q.second) / k


def pratt_williamson(rig: Rig, h: float, x: Values) -> Step:
    """Return feed-forward and PD. x: Hz, 1, s."""
    wanted, error = Filter(x[0], h), Filter(x[0], h)

    def step(ft: float, velocity: float, r: float) -> float:
        wanted(r)
        error(r - ft)
        return inverse(rig, wanted) + x[1] * error.y + x[2] * error.rate

    return step


def paine(rig: Rig, h: float, x: Values) -> Step:
    """Return PD and feed-forward inside a disturbance observer on the torque. x: of these, Hz, 1."""
    inner, seen, sent, last = pratt_williamson(rig, h, x), Filter(x[3], h), Filter(x[3], h), [0.0, 0.0]

    def step(ft: float, velocity: float, r: float) -> float:
        seen(ft)
        sent(last.pop(0))
        last.append(inner(ft, velocity, r) - x[4] * (inverse(rig, seen) - sent.y))
        return last[-1]

    return step


def ours(rig: Rig, rate: float, gains: Gains) -> Step:
    """Return this project's controller as the others are called."""
    controller = TorqueController(rig, rate, gains)
    return lambda ft, velocity, r: controller.step(Measurement(ft, velocity, 0.0), r)
