"""Robust stability, behaviour at large signals, and how far apart the benches of the set are.

No structured singular value: a dense grid of the sampled loop is exact at its points, and counts the delay
and the mode exactly (python-control's mu needs slycot, which is not installed, and a rational delay).

|T_m| = A / |P|,   |w| = A |P_w / P|          P = T_d / T_m, P_w = w / T_m, continuous, at A sin(2 pi f t)

Gain and phase of torque and output impedance of each bench under one controller:

    T / T_r = (P path D_0) / (P_0 D)        D as in margins.py; 0: the nominal bench with the same load

T is the torque on the load, not what a mode of the F/T sensor's mount makes of it; T_r is what the nominal
bench makes of a desired torque. Feed-forward and law are linear, so this is exact where nothing is learned;
what is learned of a bench brings it nearer to the nominal one up to 25 Hz, and costs gain above.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rsea_ros.control.law import FT, law_of
from rsea_ros.control.margins import Margins, encirclements, least, margins, moved_bench, returns
from rsea_ros.control.synthesis import ControllerDesign, grid
from rsea_ros.control.uncertainty import LOCKED, BenchVariant, Uncertainty, corners, dense, family, mode_of
from rsea_ros.model import outputs
from rsea_ros.model.rig import Rig
from rsea_ros.model.transfer import frequency_response
from rsea_ros.records.record import FloatArray


@dataclass(frozen=True)
class Robustness:
    """cases: how many were looked at; unstable: of these. sensitivity: the largest, to a torque on the gear
    or on the command, of the case `where`. margins: the worst of each, over all."""

    cases: int
    unstable: int
    sensitivity: float
    where: BenchVariant
    margins: Margins


def robustness(
    rig: Rig,
    loads: Mapping[str, Rig],
    designed: ControllerDesign,
    steps: int = 5,
    u: Uncertainty | None = None,
) -> Robustness:
    """Sweep the set, by default that of the design. steps: values of K_s and of b_m, each."""
    u, hz, law = u or designed.uncertainty, grid(designed.rate), law_of(rig, designed.rate, designed.gains)
    total = unstable = 0
    worst, where, every = 0.0, BenchVariant(""), []
    for name in loads:
        f = family(loads, dense((name,), u, steps), designed.rate, hz)
        memory, whole = returns(law, f.plant, hz, f.path, f.current)
        wound = encirclements(whole)
        total, unstable = total + len(f.cases), unstable + int(np.count_nonzero(wound > 0.5))
        peaks = (np.maximum(np.abs(memory), 1.0) / np.abs(whole)).max(axis=1)
        if peaks.max() > worst:
            worst, where = float(peaks.max()), f.cases[int(np.argmax(peaks))]
        every += [margins(row, hz, 1.0 / designed.rate) for row in whole / memory - 1.0]
    return Robustness(total, unstable, worst, where, least(every))


HIGHEST = 400.0
LOWEST = 0.01
POINTS = 4000


@dataclass(frozen=True)
class Reach:
    """amplitude: N m.
    torque, speed: Hz, from which it needs more of either than the motor has; inf: never.
    """

    amplitude: float
    torque: float
    speed: float

    @property
    def hz(self) -> float:
        """Where it can no longer be tracked."""
        return min(self.torque, self.speed)


def motor_demand(rig: Rig, hz: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return motor torque (N m) and speed of the gear output (rad/s) per N m of distal torque, shape (n,)."""
    torque = np.abs(frequency_response(rig, outputs.end_torque(rig, "spring_end"), hz))
    angle = np.abs(frequency_response(rig, outputs.position(), hz))
    return 1.0 / torque, 2.0 * np.pi * hz * angle / torque


def reach(rig: Rig, amplitude: float, torque: float, speed: float) -> Reach:
    """Return the lowest frequency from which an amplitude (N m) needs more than the motor has.

    torque: N m, speed: rad/s at the gear output; inf where not stated. A demand above the limit only in a
    narrow band below (a pendulum that swings) counts as well.
    """
    hz = np.geomspace(LOWEST, HIGHEST, POINTS)
    per_torque, per_speed = motor_demand(rig, hz)
    return Reach(
        amplitude, _first(hz, amplitude * per_torque > torque), _first(hz, amplitude * per_speed > speed)
    )


def _first(hz: FloatArray, short: npt.NDArray[np.bool_]) -> float:
    return float(hz[np.argmax(short)]) if short.any() else float("inf")


def largest(rig: Rig, hz: float, torque: float, speed: float) -> float:
    """Return the largest amplitude, N m, that can be tracked at a frequency, Hz."""
    per_torque, per_speed = motor_demand(rig, np.array([hz]))
    return float(min(torque / per_torque[0], speed / per_speed[0]))


NEAR = ("free x 0.5", "free x 1", "free x 2")
"""The loads about the free one that a band shows."""
CURVE_POINTS = 120


@dataclass(frozen=True)
class Spread:
    """Limits of the set at hz, shape (n,): gain over the nominal one's, dB, and phase beyond it, rad."""

    hz: FloatArray
    gain: tuple[FloatArray, FloatArray]
    phase: tuple[FloatArray, FloatArray]


@dataclass(frozen=True)
class Softness:
    """|Z|, N m s/rad, of the set's locked benches at hz, shape (n,): least, largest; worst: largest of |Z|
    over that of the same bench's spring alone."""

    hz: FloatArray
    low: FloatArray
    high: FloatArray
    worst: float


def spread(
    rig: Rig, loads: Mapping[str, Rig], design: ControllerDesign, names: Collection[str] = NEAR
) -> Spread:
    """Return by how much torque differs between the benches of some loads and the nominal one of each."""
    hz, law = grid(design.rate, CURVE_POINTS), law_of(rig, design.rate, design.gains)
    gains, phases = [], []
    for name in names:
        f = family(loads, corners((name,), design.uncertainty), design.rate, hz)
        _, whole = returns(law, f.plant, hz, f.path, f.current)
        sensor = np.array([mode_of(case.mode, hz) for case in f.cases])
        transfer = f.plant[FT] / sensor * f.path / whole
        apart = transfer / transfer[f.nominal]
        gains.append(20.0 * np.log10(np.abs(apart)))
        phases.append(np.unwrap(np.angle(apart), axis=-1))
    limits = [(np.min(v, axis=0), np.max(v, axis=0)) for v in map(np.vstack, (gains, phases))]
    return Spread(hz, *limits)


def softness(rig: Rig, design: ControllerDesign, hz: FloatArray) -> Softness:
    """Return the impedance of the set's locked benches. hz: below half the rate."""
    law, cases = law_of(rig, design.rate, design.gains), corners((LOCKED,), design.uncertainty)
    benches = [moved_bench(rig, design.rate, hz, case) for case in cases]
    impedances = np.abs([bench.impedance(law) for bench in benches])
    worst = max(float(bench.ratio(law).max()) for bench in benches)
    return Softness(hz, impedances.min(axis=0), impedances.max(axis=0), worst)
