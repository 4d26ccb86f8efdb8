"""Gains by synthesis: the least friction left in the torque that the margins over all loads allow.

    minimise    the worst over the loads of  sqrt(sum over n = 1, 3, 5 … of (4 / (n pi))^2 |P S(n f)|^2 / 2)
    subject to  phase margin >= 45 deg locked, >= 35 deg with any other load
                gain margin >= 6 dB up and down, delay margin >= 1 sample, |L| <= 1 above a quarter of the
                rate

That is the RMS torque error for each N m of Coulomb friction that nobody has foreseen while the actuator
goes to and fro at f: a square wave on the gear through the closed loop. P = T_d / T_m, S = 1 / (1 + L),
sampled, with hold and one sample of delay, exact at every frequency. The three gains come from Nelder and
Mead's search in their logarithms; what breaks a margin costs. Then the poles of the closed loop, taken from
the code that runs, decide whether the design is let through.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from scipy.optimize import minimize

from rsea_ros.control.lags import lagging
from rsea_ros.control.law import Gains, law_of
from rsea_ros.control.loads import LOCKED
from rsea_ros.control.loop import largest_pole, open_loop
from rsea_ros.control.margins import Margins, margins
from rsea_ros.control.sampled import FT, Sampled, sampled
from rsea_ros.errors import ParameterError
from rsea_ros.model.rig import Rig
from rsea_ros.signals import ComplexArray, FloatArray

LOWEST = 0.2
"""Hz, where the grid of frequencies begins."""

SHARES = (1.0, 0.5, 0.2, 0.05, 0.0)
"""Of the torque: the loop must be stable with each of them, so that limits cannot make it oscillate."""

MARGINAL = 1.0 + 1e-6
"""A bench whose end turns freely has a pole at 1, which the torque does not show."""

EVALUATIONS, POLISHES = 150, 3
"""Of a search, and how often it is begun anew where it ended: a simplex that has met a margin lies flat."""

MOVEMENT = 5.0
"""Hz, at which the actuator goes to and fro."""
_START = ((1.0, 0.5, 0.25), (3.0, 1.0, 0.1), (0.5, 0.3, 0.15))
"""k_p; k_d in 1 / (2 pi 10 Hz); q_frequency over the rate."""


@dataclass(frozen=True)
class Demand:
    """Least margins: deg with both ends clamped, deg with any other load, dB, samples."""

    phase_locked: float = 45.0
    phase: float = 35.0
    gain: float = 6.0
    delay: float = 1.0


@dataclass(frozen=True)
class Design:
    """Gains at a rate (Hz), margins by load; friction_left: what was made least, N m RMS per N m."""

    gains: Gains
    rate: float
    margins: Mapping[str, Margins]
    friction_left: float


@dataclass(frozen=True)
class Bench:
    """One load: the sampled bench, and its response with the lags of its effects, shape (3, n)."""

    plant: Sampled
    response: ComplexArray


def design(rig: Rig, loads: Mapping[str, Rig], rate: float, demand: Demand | None = None) -> Design:
    """Return the gains of a rig. Raises ParameterError where none meet the demand for every load."""
    demand = demand or Demand()
    hz, benches = _benches(loads, rate)

    def cost(x: FloatArray) -> float:
        gains = _gains(x, rate)
        found = _loops(rig, rate, gains, hz, benches)
        left = float(np.log(_friction_left(found, hz, benches)))
        return left + 1e3 * _lacking(found, hz, rate, demand)

    best = min((_search(cost, np.log(np.array(start))) for start in _START), key=lambda found: found[1])
    for _ in range(POLISHES):
        best = _search(cost, best[0])
    found = check(rig, loads, rate, _gains(best[0], rate))
    short = _lacking(_loops(rig, rate, found.gains, hz, benches), hz, rate, demand)
    if short > 0.02:
        raise ParameterError(
            f"rig {rig.name}: no gains keep the margins for every load at {rate:g} Hz: {worst(found)}"
        )
    return found


def check(rig: Rig, loads: Mapping[str, Rig], rate: float, gains: Gains) -> Design:
    """Return margins of given gains. Raises ParameterError where the loop is unstable with a load."""
    hz, benches = _benches(loads, rate)
    law = law_of(rig, rate, gains)
    for name, bench in benches.items():
        for share in SHARES:
            pole = largest_pole(law, bench.plant, share)
            if pole > MARGINAL:
                raise ParameterError(
                    f"rig {rig.name}: unstable at {rate:g} Hz with load {name!r}, {share:.0%} of the torque: "
                    f"closed-loop pole of modulus {pole:.4f}, expected below 1; {gains}"
                )
    loops = _loops(rig, rate, gains, hz, benches)
    for name, loop in loops.items():
        if _encirclements(loop) > 0.0:
            raise ParameterError(
                f"rig {rig.name}: unstable at {rate:g} Hz with load {name!r} and the lags of its effects, "
                f"expected a loop that does not encircle -1; {gains}"
            )
    found = {name: margins(loop, hz, 1.0 / rate) for name, loop in loops.items()}
    return Design(gains, rate, MappingProxyType(found), _friction_left(loops, hz, benches))


def worst(found: Design) -> str:
    """Return the least margins in words."""
    name, least = min(found.margins.items(), key=lambda item: item[1].phase)
    return (
        f"phase margin {least.phase:.1f} deg, gain margin {least.gain:.1f} dB, "
        f"delay margin {least.delay:.2f} samples with load {name!r}"
    )


def grid(rate: float) -> FloatArray:
    """Return frequencies up to half the rate, Hz, those of the movement among them."""
    highest = 0.4995 * rate
    low = np.geomspace(LOWEST, 0.02 * rate, 80)
    return np.unique(np.concatenate([low, np.linspace(0.02 * rate, highest, 400), MOVEMENT * _odd(highest)]))


def _benches(loads: Mapping[str, Rig], rate: float) -> tuple[FloatArray, dict[str, Bench]]:
    hz = grid(rate)
    plants = {name: sampled(load, rate) for name, load in loads.items()}
    return hz, {name: Bench(plant, lagging(loads[name], plant, hz)) for name, plant in plants.items()}


def _loops(
    rig: Rig, rate: float, gains: Gains, hz: FloatArray, benches: Mapping[str, Bench]
) -> dict[str, ComplexArray]:
    law = law_of(rig, rate, gains)
    return {name: open_loop(law, bench.response, hz) for name, bench in benches.items()}


def _friction_left(loops: Mapping[str, ComplexArray], hz: FloatArray, benches: Mapping[str, Bench]) -> float:
    """Return the RMS torque error per N m of friction, the worst of the loads."""
    n = _odd(hz[-1])
    at = np.searchsorted(hz, n * MOVEMENT)
    square = 4.0 / (np.pi * n) / np.sqrt(2.0)
    left = [
        square * np.abs(benches[name].response[FT, at] / (1.0 + loop[at])) for name, loop in loops.items()
    ]
    return float(np.sqrt(np.max(np.sum(np.square(left), axis=1))))


def _odd(highest: float) -> FloatArray:
    """Return 1, 3, 5 … of the harmonics of the movement below a frequency, Hz."""
    return np.arange(1.0, highest / MOVEMENT, 2.0)


def _lacking(loops: Mapping[str, ComplexArray], hz: FloatArray, rate: float, demand: Demand) -> float:
    """Return by how much margins are short of the demand, as parts of it, added up; 0 when met."""
    total = 0.0
    for name, loop in loops.items():
        m = margins(loop, hz, 1.0 / rate)
        phase = demand.phase_locked if name == LOCKED else demand.phase
        steep = float(np.abs(loop[hz > 0.25 * rate]).max())
        wound = _encirclements(loop)
        parts = (
            1.0 - m.phase / phase,
            1.0 - m.gain / demand.gain,
            1.0 - m.delay / demand.delay,
            steep - 1.0,
            10.0 * wound,
        )
        total += sum(max(0.0, part) for part in parts)
    return total


def _encirclements(loop: ComplexArray) -> float:
    """Return how often 1 + L turns about zero beyond what its ends show: never when it is stable."""
    turned = np.unwrap(np.angle(1.0 + loop))
    straight = np.angle(1.0 + loop[-1]) - np.angle(1.0 + loop[0])
    return float(abs(round((turned[-1] - turned[0] - straight) / (2.0 * np.pi))))


def _gains(x: FloatArray, rate: float) -> Gains:
    k_p, k_d, q = np.exp(np.clip(x, -12.0, 6.0))
    return Gains(float(k_p), float(k_d) / (2.0 * np.pi * 10.0), float(min(q, 0.45)) * rate)


def _search(cost: Callable[[FloatArray], float], start: FloatArray) -> tuple[FloatArray, float]:
    options = {"maxfev": EVALUATIONS, "xatol": 1e-3, "fatol": 1e-4}
    found = minimize(cost, start, method="Nelder-Mead", options=options)
    return found.x, float(found.fun)
