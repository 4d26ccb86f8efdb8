"""How far apart the benches of the set are under one controller: gain and phase of torque, output impedance.

    T / T_r = (P path D_0) / (P_0 D)        D as in loop.py; 0: the nominal bench with the same load

T is the torque on the load, not what a mode of the F/T sensor's mount makes of it; T_r is what the nominal
bench makes of a desired torque. Feed-forward and law are linear, so this is exact where nothing is learned;
what is learned of a bench brings it nearer to the nominal one up to 25 Hz, and costs gain above.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np

from rsea_ros.control.impedance import moved_bench
from rsea_ros.control.law import FT, law_of
from rsea_ros.control.loads import LOCKED
from rsea_ros.control.margins import returns
from rsea_ros.control.synthesis import ControllerDesign, grid
from rsea_ros.control.uncertainty import Uncertainty, corners, family, mode_of
from rsea_ros.model.rig import Rig
from rsea_ros.records.record import FloatArray

NEAR = ("free x 0.5", "free x 1", "free x 2")
"""The loads about the free one that a band shows."""
POINTS = 120


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
    hz, law = grid(design.rate, POINTS), law_of(rig, design.rate, design.gains)
    gains, phases = [], []
    for name in names:
        u = Uncertainty()
        f = family(loads, corners((name,), u), u, design.rate, hz)
        _, whole = returns(law, f.plant, hz, f.path, f.current)
        sensor = np.array([mode_of(u.mode, case.participation, hz) for case in f.cases])
        transfer = f.plant[FT] / sensor * f.path / whole
        apart = transfer / transfer[f.nominal]
        gains.append(20.0 * np.log10(np.abs(apart)))
        phases.append(np.unwrap(np.angle(apart), axis=-1))
    limits = [(np.min(v, axis=0), np.max(v, axis=0)) for v in map(np.vstack, (gains, phases))]
    return Spread(hz, *limits)


def softness(rig: Rig, design: ControllerDesign, hz: FloatArray) -> Softness:
    """Return the impedance of the set's locked benches. hz: below half the rate."""
    u, law = Uncertainty(), law_of(rig, design.rate, design.gains)
    benches = [moved_bench(rig, design.rate, hz, case, u) for case in corners((LOCKED,), u)]
    impedances = np.abs([bench.impedance(law) for bench in benches])
    worst = max(float(bench.ratio(law).max()) for bench in benches)
    return Softness(hz, impedances.min(axis=0), impedances.max(axis=0), worst)
