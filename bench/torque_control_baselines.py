"""Controllers of the literature, each in about ten lines, on the same trials as this project's.

All measure ft and velocity at the samples and command one sample later, as the project's does. Their gains
are as high as the nominal locked loop allows; none knows a load.

none               u = r
pratt_williamson   inverse of the locked actuator on r, PD on the torque error (Pratt, Williamson, Series
                   elastic actuators, IEEE/RSJ IROS 1995)
vallery            torque PI gives a speed, an inner PI follows it (Vallery, Ekkelenkamp, van der Kooij, Buss,
                   Passive and accurate torque control of series elastic actuators, IEEE/RSJ IROS 2007)
paine              PD with feed-forward, and a disturbance observer on the closed loop's torque (Paine, Oh,
                   Sentis, IEEE/ASME Trans. Mechatronics 19, 2014)
kong               disturbance observer at the motor, with the inverse of T_d / T_m as nominal model (Kong,
                   Bae, Tomizuka, IEEE/ASME Trans. Mechatronics 14, 2009; rotary SEA: 17, 2012)
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from rsea_ros.control.controller import Measurement, TorqueController
from rsea_ros.control.law import Gains
from rsea_ros.control.loads import LOCKED, load_range
from rsea_ros.control.settings import TorqueLimits
from rsea_ros.control.synthesis import design
from rsea_ros.control.trials import amplitude_of, disturbed
from rsea_ros.control.uncertainty import BenchVariant, bench
from rsea_ros.model.rig import Rig
from rsea_ros.model.simulation import Plant

Step = Callable[[float, float, float], float]
"""(ft, velocity, desired) -> command."""


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


def none(rig: Rig, h: float) -> Step:
    """Return r itself."""
    return lambda ft, velocity, r: r


def inverse(rig: Rig, q: Filter) -> float:
    """Return Q (J s^2 + b s + K) / K of the signal that went through Q."""
    j, b, k = rig["rotor.reflected_inertia"], rig["rotor.reflected_damping"], rig["spring.stiffness"]
    return q.y + (b * q.rate + j * q.second) / k


def pratt_williamson(rig: Rig, h: float) -> Step:
    """Return feed-forward and PD."""
    wanted, error = Filter(60.0, h), Filter(60.0, h)

    def step(ft: float, velocity: float, r: float) -> float:
        wanted(r)
        error(r - ft)
        return inverse(rig, wanted) + 1.0 * error.y + 0.01 * error.rate

    return step


def vallery(rig: Rig, h: float) -> Step:
    """Return a torque PI around a speed PI."""
    k, sums = rig["spring.stiffness"], [0.0, 0.0]

    def step(ft: float, velocity: float, r: float) -> float:
        sums[0] += h * (r - ft)
        speed = 25.0 / k * (r - ft) + 25.0 / k * sums[0]
        sums[1] += h * (speed - velocity)
        return 50.0 * (speed - velocity) + 100.0 * sums[1]

    return step


def paine(rig: Rig, h: float) -> Step:
    """Return PD and feed-forward inside a disturbance observer on the torque."""
    inner, seen, sent, last = pratt_williamson(rig, h), Filter(6.0, h), Filter(6.0, h), [0.0, 0.0]

    def step(ft: float, velocity: float, r: float) -> float:
        seen(ft)
        sent(last.pop(0))
        last.append(inner(ft, velocity, r) - 0.5 * (inverse(rig, seen) - sent.y))
        return last[-1]

    return step


def kong(rig: Rig, h: float) -> Step:
    """Return a disturbance observer at the motor around an optimal PD."""
    seen, sent, error, last = Filter(8.0, h), Filter(8.0, h), Filter(60.0, h), [0.0, 0.0]

    def step(ft: float, velocity: float, r: float) -> float:
        seen(ft)
        sent(last.pop(0))
        error(r - ft)
        last.append(r + 0.5 * error.y + 0.01 * error.rate - (inverse(rig, seen) - sent.y))
        return last[-1]

    return step


METHODS: dict[str, Callable[[Rig, float], Step]] = {
    "none": none, "pratt_williamson": pratt_williamson, "vallery": vallery, "paine": paine, "kong": kong,
}  # fmt: skip


def cases(loads: Sequence[str]) -> dict[str, BenchVariant]:
    """Return the benches of the page."""
    return {
        "locked": BenchVariant(LOCKED),
        "free": BenchVariant("free x 1"),
        "free, half": BenchVariant("free x 0.5"),
        "locked, K_s + 10 %, b_m - 50 %": BenchVariant(LOCKED, 1.1, 0.5),
        "locked, a sample and 2 ms late": BenchVariant(LOCKED, 1.0, 1.0, 1, 2e-3),
        "locked, all of it and the mode": BenchVariant(LOCKED, 1.1, 0.5, 1, 2e-3, 0.3),
    }


def error_of(step: Step, true: Rig, rate: float, amplitude: float, late: int) -> float:
    """Return the error of a sine of 5 Hz from 3 s on, over its RMS; above 1 the controller is useless."""
    plant, limit = Plant(true, rate), TorqueLimits().torque
    sample, pending, errors = plant.step(0.0), [0.0] * (1 + late), []
    for k in range(round(4.0 * rate)):
        wanted = amplitude * min(1.0, 4.0 * k / rate) ** 2 * math.sin(2.0 * math.pi * 5.0 * k / rate)
        errors.append(sample.ft - wanted)
        command = min(max(step(sample.ft, sample.velocity, wanted), -limit), limit)
        sample = plant.step(pending.pop(0))
        pending.append(command)
    return float(np.sqrt(2.0 * np.mean(np.square(errors[round(3.0 * rate) :]))) / amplitude)


def ours(rig: Rig, rate: float, gains: Gains) -> Step:
    """Return this project's controller as the others are called."""
    controller = TorqueController(rig, rate, gains)
    return lambda ft, velocity, r: controller.step(Measurement(ft, velocity, 0.0), r)


def baselines(rig: Rig, free: Rig, rates: Sequence[float]) -> Iterator[str]:
    """Print the error of each on each bench."""
    loads = load_range(rig, free)
    for rate in rates:
        gains = design(rig, loads, rate).gains
        made = {name: partial(method, rig, 1.0 / rate) for name, method in METHODS.items()}
        made["this project's"] = partial(ours, rig, rate, gains)
        yield f"| {rate:g} Hz, error of 5 Hz, % | " + " | ".join(cases(tuple(loads))) + " |"
        for name, begin in made.items():
            cells = []
            for case in cases(tuple(loads)).values():
                amplitude = amplitude_of(bench(loads[case.load], case))
                error = error_of(begin(), disturbed(loads, case), rate, amplitude, case.samples)
                cells.append(f"{100.0 * error:.1f}" if error < 1.5 else "unstable")
            yield f"| {name} | " + " | ".join(cells) + " |"
