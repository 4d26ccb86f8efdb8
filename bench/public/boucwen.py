"""Bouc-Wen: a simulated hysteretic oscillator, by the rig whose spring has the general law of hysteresis.

White box: the law that made the data is the law that is fitted, so this tests the simulation and the solver.
Metric of the benchmark: RMS error in m, of the multisine in its steady state, of the sweep from rest. The
test multisine is one period: it is simulated twice and scored the second time.

The lock has no HDF5 library: PLACES says where the arrays of the published files lie, each in one piece.
"""

from itertools import product

import numpy as np

from bench.public.fit import DATA, RIGS, Score, case_of, error_of, fit_rig, record_of, rig_of
from rsea_ros.model.rig import EffectSetting, Rig
from rsea_ros.model.rig_file import load_rig
from rsea_ros.records.record import FloatArray, Record

RATE, TORQUE = 750.0, 0.2
SETTLED, TRIED = 300, 4096
PUBLISHED = {
    "multisine": ("best found 7.5e-6, PNLSS 1.87e-5, dynoNet 4.5e-5, linear 1.75e-4", 6.5e-6),
    "sine sweep": ("none at hand", 3.1e-6),
}
PLACES = {
    "train": (658_344, {"multisine/u": (2432, 40960), "multisine/y": (330_384, 40960)}),
    "test": (2_585_288, {
        "multisine/u": (69_688, 8192), "multisine/y": (2104, 8192),
        "sinesweep/u": (1_361_280, 153_000), "sinesweep/y": (137_280, 153_000),
    }),
}  # fmt: skip
"""Of each file: its bytes, and of each array where it begins and how many numbers of 64 bits it has."""


def scores() -> list[Score]:
    """Return the two tests of a rig that was fitted to the training record."""
    train, test = arrays("train"), arrays("test")
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


def arrays(name: str) -> dict[str, FloatArray]:
    """Return the arrays of a file by name, such as `multisine/u`.

    Raises ValueError where the file is not the published one.
    """
    size, places = PLACES[name]
    path = DATA / "boucwen" / f"{name}.h5"
    if path.stat().st_size != size:
        raise ValueError(f"{path}: {path.stat().st_size} bytes, expected {size}")
    return {n: np.fromfile(path, "<f8", count, offset=at) for n, (at, count) in places.items()}
