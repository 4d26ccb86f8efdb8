"""Bouc-Wen: a simulated hysteretic oscillator, by the rig whose spring has the general law of hysteresis.

White box: the law that made the data is the law that is fitted, so this tests the simulation and the solver.
Metric of the benchmark: RMS error in m, of the multisine in its steady state, of the sweep from rest. The
test multisine is one period: it is simulated twice and scored the second time.
"""

from __future__ import annotations

from itertools import product

import numpy as np

from bench.public.fit import DATA, RIGS, Score, case_of, error_of, fit_rig, record_of, rig_of
from bench.public.hdf5 import arrays
from rsea_ros.model.rig import EffectSetting, Rig
from rsea_ros.model.rig_file import load_rig
from rsea_ros.records.record import Record

RATE, TORQUE = 750.0, 0.2
SETTLED, TRIED = 300, 4096
PUBLISHED = {
    "multisine": ("best found 7.5e-6, PNLSS 1.87e-5, dynoNet 4.5e-5, linear 1.75e-4", 6.5e-6),
    "sine sweep": ("none at hand", 3.1e-6),
}


def scores() -> list[Score]:
    """Return the two tests of a rig that was fitted to the training record."""
    train, test = (arrays(DATA / "boucwen" / f"{name}.h5") for name in ("train", "test"))
    rig = _rig(record_of(TORQUE * train["multisine/u"], train["multisine/y"], RATE))
    u, y = (np.tile(test[f"multisine/{n}"], 2) for n in "uy")
    errors = {
        "multisine": error_of(rig, record_of(TORQUE * u, y, RATE), skip=len(u) // 2),
        "sine sweep": error_of(rig, record_of(TORQUE * test["sinesweep/u"], test["sinesweep/y"], RATE)),
    }
    return [Score(f"Bouc-Wen, {n}", e, "m", *PUBLISHED[n]) for n, e in errors.items()]


def _rig(record: Record) -> Rig:
    """Return the rig fitted to a record, from the best of a few coarse sizes of its hysteresis."""
    begun = load_rig(RIGS / "bouc_wen.yaml")
    start = record.between(record.start, record.start + TRIED / RATE)
    sizes = product((2.0, 10.0), (5e-4, 2e-3), (-1.0, 0.0))
    laws = [{"torque": t, "angle": a, "gamma": g} for t, a, g in sizes]
    rigs = [begun.with_effects(EffectSetting("spring_hysteresis", law)) for law in laws]
    tried = [fit_rig(rig, [case_of(rig, start, SETTLED, refine=1)], iterations=15) for rig in rigs]
    best = rig_of(min(tried, key=lambda s: s.cost))
    return rig_of(fit_rig(best, [case_of(best, record, SETTLED)]))
