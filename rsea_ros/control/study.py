"""The study of a controlled actuator: design at each rate, trials, impedance, limits."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from rsea_ros.control.following import Following, follow
from rsea_ros.control.impedance import OutputImpedance, impedance
from rsea_ros.control.loads import LOCKED, load_range, with_ends
from rsea_ros.control.robustness import (
    Reach,
    Robustness,
    Softness,
    Spread,
    reach,
    robustness,
    softness,
    spread,
)
from rsea_ros.control.synthesis import ControllerDesign, design
from rsea_ros.control.trials import Compensated, TrialResult, compensations, hard, trials
from rsea_ros.errors import ParameterError
from rsea_ros.model.propagator import state_space
from rsea_ros.model.rig import Rig

AMPLITUDES = (10.0, 20.0, 40.0)


@dataclass(frozen=True)
class MotorLimits:
    """The motor's limits at the gear output: N m, rad/s (inf: not stated), and their source."""

    name: str
    torque: float
    speed: float
    source: str


@dataclass(frozen=True)
class AtRate:
    """One rate: design, the set swept, trials, gain of each compensation, impedance; T_d / desired of the
    clamped bench and of the free one, and what the set makes of each and of the impedance."""

    design: ControllerDesign
    swept: Robustness
    trials: tuple[TrialResult, ...]
    compensations: tuple[Compensated, ...]
    locked: Following
    free: Following
    locked_spread: Spread
    free_spread: Spread
    impedance: OutputImpedance
    softness: Softness


@dataclass(frozen=True)
class Study:
    """rig: both ends clamped; free: the same actuator with the lightest load.

    resonance: of the open loop, Hz.
    reaches: by motor, for the clamped and for the free rig, at each of AMPLITUDES.
    """

    rig: Rig
    free: Rig
    resonance: float
    rates: tuple[AtRate, ...]
    reaches: Mapping[MotorLimits, tuple[tuple[Reach, Reach], ...]]


def study(
    rig: Rig,
    free: Rig,
    rates: Sequence[float],
    motors: Sequence[MotorLimits] = (),
    progress: Callable[[str, float], None] = lambda step, share: None,
) -> Study:
    """Return the study of a rig's actuator. free: a rig whose ends are the lightest load.

    Raises ParameterError where the synthesis finds no gains, or where `free` is clamped at both ends.
    """
    if not rates:
        raise ParameterError("no rate, expected at least one, Hz")
    loads = load_range(rig, free)
    clamped, light = loads[LOCKED], with_ends(rig, free)
    resonance = natural_frequency(clamped)
    done = []
    for k, rate in enumerate(rates):
        progress(f"{rate:g} Hz", k / len(rates))
        designed = design(rig, loads, rate)
        done.append(_at_rate(clamped, light, loads, designed))
    reaches = {motor: tuple(_reaches(clamped, light, a, motor) for a in AMPLITUDES) for motor in motors}
    return Study(clamped, light, resonance, tuple(done), reaches)


def natural_frequency(rig: Rig) -> float:
    """Return the lowest natural frequency of a rig's open loop, Hz."""
    poles = np.linalg.eigvals(state_space(rig).a)
    return float(np.abs(poles[np.abs(poles) > 0.0]).min()) / (2.0 * math.pi)


def _at_rate(clamped: Rig, light: Rig, loads: Mapping[str, Rig], designed: ControllerDesign) -> AtRate:
    swept = robustness(clamped, loads, designed, steps=3)
    grid = np.geomspace(0.1, 0.45 * designed.rate, 300)
    near = follow(clamped, clamped, designed)
    far = follow(hard(loads), clamped, designed, late=1)
    apart, softest = spread(clamped, loads, designed, (LOCKED,)), softness(clamped, designed, grid)
    return AtRate(
        designed,
        swept,
        tuple(trials(clamped, loads, designed, swept, near, far, apart, softest.worst)),
        tuple(compensations(clamped, designed)),
        near,
        follow(light, clamped, designed),
        apart,
        spread(clamped, loads, designed),
        impedance(clamped, designed.rate, designed.gains, grid),
        softest,
    )


def _reaches(clamped: Rig, light: Rig, amplitude: float, motor: MotorLimits) -> tuple[Reach, Reach]:
    at, free = (reach(rig, amplitude, motor.torque, motor.speed) for rig in (clamped, light))
    return at, free
