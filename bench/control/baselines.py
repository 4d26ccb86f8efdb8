"""Controllers of the literature, each in about ten lines, on the same trials as this project's.

All measure ft and velocity at the samples and command one sample later, as the project's does. None knows a
load. Their gains are searched at each rate for the smallest error of the trial itself on the locked bench, in
time and a sample and 2 ms late, among those that are stable on the lightest and on the hardest bench.

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

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.optimize import minimize

from bench.results import Row
from rsea_ros.control.controller import Measurement, TorqueController
from rsea_ros.control.law import Gains
from rsea_ros.control.study import amplitude_of, disturbed_rig
from rsea_ros.control.synthesis import design
from rsea_ros.control.uncertainty import LOCKED, BenchVariant, load_range, variant_rig
from rsea_ros.model.rig import Rig, motor_torque
from rsea_ros.model.simulation import Plant
from rsea_ros.records.record import FloatArray

Step = Callable[[float, float, float], float]
"""(ft, velocity, desired) -> command."""
Values = Sequence[float]
TRIED, STRIDE, UNWANTED = 70, -0.5, 10.0
"""Sets of gains that a search tries, its first step in their logarithm, the cost of an unstable set."""


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


def vallery(rig: Rig, h: float, x: Values) -> Step:
    """Return a torque PI around a speed PI. x: 1/s, 1/s^2, N m s/rad, N m/rad."""
    k, sums = rig["spring.stiffness"], [0.0, 0.0]

    def step(ft: float, velocity: float, r: float) -> float:
        sums[0] += h * (r - ft)
        speed = (x[0] * (r - ft) + x[1] * sums[0]) / k
        sums[1] += h * (speed - velocity)
        return x[2] * (speed - velocity) + x[3] * sums[1]

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


def kong(rig: Rig, h: float, x: Values) -> Step:
    """Return a disturbance observer at the motor around an optimal PD. x: Hz, Hz, 1, s."""
    seen, sent, error, last = Filter(x[0], h), Filter(x[0], h), Filter(x[1], h), [0.0, 0.0]

    def step(ft: float, velocity: float, r: float) -> float:
        seen(ft)
        sent(last.pop(0))
        error(r - ft)
        last.append(r + x[2] * error.y + x[3] * error.rate - (inverse(rig, seen) - sent.y))
        return last[-1]

    return step


METHODS: dict[str, tuple[Callable[[Rig, float, Values], Step], Values]] = {
    "none": (none, ()),
    "pratt_williamson": (pratt_williamson, (60.0, 1.0, 0.01)),
    "vallery": (vallery, (25.0, 25.0, 50.0, 100.0)),
    "paine": (paine, (60.0, 1.0, 0.01, 6.0, 0.5)),
    "kong": (kong, (8.0, 60.0, 0.5, 0.01)),
}
"""Each with the gains that its search begins at."""


IN_TIME, LATE = BenchVariant(LOCKED), BenchVariant(LOCKED, 1.0, 1.0, 1, 2e-3)
MODE = (33.0, 0.02, 0.3)
"""Hz, damping ratio, participation, of the paper's F/T sensor."""
WITHIN = (BenchVariant("free x 0.5"), BenchVariant(LOCKED, 1.1, 0.5, 1, 2e-3, MODE))
"""The lightest bench of the page, and the hardest locked one."""
UNSTABLE = 1.5
"""An error above this is no control."""
LOST = 20.0
"""Of the amplitude: a torque that is so far off does not come back."""


def cases() -> dict[str, BenchVariant]:
    """Return the benches of the page."""
    return {
        "locked": IN_TIME,
        "free": BenchVariant("free x 1"),
        "free, half": WITHIN[0],
        "locked, K_s + 10 %, b_m - 50 %": BenchVariant(LOCKED, 1.1, 0.5),
        "locked, a sample and 2 ms late": LATE,
        "locked, all of it and the mode": WITHIN[1],
    }


def tune(name: str, rig: Rig, loads: Mapping[str, Rig], rate: float) -> Values:
    """Return the gains of a method with the least errors on the locked bench, in time and late.

    They keep the benches of WITHIN stable: without that, each of the four follows better and is unstable on
    one of them.
    """
    method, start = METHODS[name]
    followed = [(case, disturbed_rig(loads, case)) for case in (IN_TIME, LATE)]
    within = [(case, disturbed_rig(loads, case)) for case in WITHIN]

    def error(x: Values, case: BenchVariant, true: Rig) -> float:
        amplitude = amplitude_of(variant_rig(loads[case.load], case))
        return error_of(method(rig, 1.0 / rate, x), true, rate, amplitude, case.samples)

    def cost(x: FloatArray) -> float:
        errors = [error(np.exp(x), *each) for each in followed]
        if max(errors) < UNSTABLE and all(error(np.exp(x), *each) < UNSTABLE for each in within):
            return float(np.sum(np.log(errors)))
        return UNWANTED

    simplex = np.log(start) + np.vstack([np.zeros(len(start)), STRIDE * np.eye(len(start))])
    options = {"maxfev": TRIED, "xatol": 1e-2, "fatol": 1e-3, "adaptive": True, "initial_simplex": simplex}
    optimum = minimize(cost, np.log(start), method="Nelder-Mead", options=options) if start else None
    return [float(value) for value in np.exp(optimum.x)] if optimum else start


def error_of(step: Step, true: Rig, rate: float, amplitude: float, late: int) -> float:
    """Return the error of a sine of 5 Hz from 3 s on, over its RMS; above 1 the controller is useless."""
    plant, limit = Plant(true, rate), motor_torque(true)[0]
    sample, pending, errors = plant.step(0.0), [0.0] * (1 + late), []
    for k in range(round(4.0 * rate)):
        wanted = amplitude * min(1.0, 4.0 * k / rate) ** 2 * math.sin(2.0 * math.pi * 5.0 * k / rate)
        errors.append(sample.ft - wanted)
        if abs(errors[-1]) > LOST * amplitude:
            return math.inf
        command = min(max(step(sample.ft, sample.velocity, wanted), -limit), limit)
        sample = plant.step(pending.pop(0))
        pending.append(command)
    return float(np.sqrt(2.0 * np.mean(np.square(errors[round(3.0 * rate) :]))) / amplitude)


def ours(rig: Rig, rate: float, gains: Gains) -> Step:
    """Return this project's controller as the others are called."""
    controller = TorqueController(rig, rate, gains)
    return lambda ft, velocity, r: controller.step(Measurement(ft, velocity, 0.0), r)


def baselines(rig: Rig, free: Rig, rate: float) -> Iterator[Row | str]:
    """Print the gains of each, and its error of 5 Hz on each bench, %; some minutes a rate."""
    loads, made = load_range(rig, free), dict[str, Callable[[], Step]]()
    for name in METHODS:
        x = tune(name, rig, loads, rate)
        yield f"{rate:g} Hz, {name}: {', '.join(f'{value:.3g}' for value in x) or 'no gains'}"
        made[name] = partial(METHODS[name][0], rig, 1.0 / rate, x)
    made["this project's"] = partial(ours, rig, rate, design(rig, loads, rate).gains)
    for name, begin in made.items():
        cells = {}
        for where, case in cases().items():
            amplitude = amplitude_of(variant_rig(loads[case.load], case))
            error = error_of(begin(), disturbed_rig(loads, case), rate, amplitude, case.samples)
            cells[where] = f"{100.0 * error:.1f}" if error < UNSTABLE else "unstable"
        yield Row(name, "", cells)
