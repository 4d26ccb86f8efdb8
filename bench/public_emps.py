"""EMPS: a linear drive without a spring, simulated freely on the measured force, from end to end.

No position of the test is used but its first 20 samples, which give position and velocity at the start; a
velocity of 6 mm/s left out there costs 3 mm at the end. The fit is by output error on position on the
identification record, the friction law the one that predicts the last third of that record best when it is
fitted to the first two: the test record chooses nothing.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.io import loadmat

from bench.public_fit import DATA, Score, error_from, fitted, record_of, rig_of
from rsea_ros.model.rig import EffectSetting, Rig
from rsea_ros.model.rig_file import load_rig
from rsea_ros.signals import Record

RATE, WINDOW = 1000.0, 20
COULOMB = EffectSetting("coulomb_friction", {"torque": 20.0, "creep_velocity": 1e-5})
ONE_SIDED = EffectSetting("asymmetric_friction", {"offset": 0.0, "viscous_difference": 0.0})
STRIBECK = EffectSetting(
    "stribeck_friction",
    {"coulomb_torque": 20.0, "stribeck_torque": 2.0, "stribeck_velocity": 0.02, "creep_velocity": 3e-4},
)
DRAG = EffectSetting("quadratic_drag", {"coefficient": 1.0})
ALIKE = "asymmetric_friction.viscous_difference"
LAWS = (
    ((COULOMB, ONE_SIDED), {ALIKE}),
    ((COULOMB, ONE_SIDED), set()),
    ((COULOMB, ONE_SIDED, DRAG), {ALIKE}),
    ((STRIBECK, ONE_SIDED), {ALIKE}),
)
"""Laws of friction, and what of them is held at its start."""


def scores() -> list[Score]:
    """Return the test on the record with pulses."""
    train, test = (_record(name) for name in ("DATA_EMPS.mat", "DATA_EMPS_PULSES.mat"))
    two_thirds = train.start + 16.0
    first, last = train.between(train.start, two_thirds), train.between(two_thirds, np.inf)
    rig = min(_rigs(), key=lambda r: _error(_fitted(r, first), last))
    names = "+".join(e.name for e in rig.effects)
    published = "baselines from 5.17; published values of the drive 8.4 here"
    return [Score(f"EMPS, free run ({names})", _error(_fitted(rig, train), test), "mm", published, 4.9)]


def _record(name: str) -> Record:
    """Return force (N) and position (m) of a file."""
    data = loadmat(DATA / "emps" / name)
    force = np.ravel(data["vir"]) * float(np.ravel(data["gtau"])[0])
    return record_of(force.astype(float), np.ravel(data["qm"]).astype(float), RATE)


def _rigs() -> list[Rig]:
    """Return the drive with each law of friction."""
    rig = load_rig("emps")
    fixed = {"gear.ratio", "spring_end.inertia"}
    fixed_of = {e.name: f"{e.name}.creep_velocity" for e in (COULOMB, STRIBECK)}
    return [
        replace(rig.with_effects(*law), known=frozenset(fixed | held | {fixed_of[law[0].name]}))
        for law, held in LAWS
    ]


def _fitted(rig: Rig, record: Record) -> Rig:
    return rig_of(fitted(rig, record, WINDOW, refine=1, iterations=30, initial=_start(record)))


def _error(rig: Rig, record: Record) -> float:
    """Return the RMS error of a free run, mm."""
    return 1e3 * error_from(rig, record, WINDOW, refine=1, initial=_start(record))


def _start(record: Record) -> tuple[float, float]:
    """Return position and velocity at the start, by a parabola through the first samples."""
    q = record["position"].y[:WINDOW]
    return float(q[0]), float(np.polyfit(np.arange(WINDOW) / RATE, q, 2)[1])
