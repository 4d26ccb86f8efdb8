"""CMA-ES over values of the joint of second_order.py, as BAM and PACE fit theirs."""

from __future__ import annotations

import cma
import numpy as np
from common import NotApplicable, PeerCase
from second_order import NAMES, simulate_run

SIGMA, SHORTEST = 0.3, 0.2
"""First step, in units of a value's scale; share of the budget that is left for the last simulation."""
PHYSICS = ("sea", "joint", "drive")


def start_values(case: PeerCase) -> dict[str, float]:
    """Return the stated values, and the null of every other one. Raises NotApplicable without physics."""
    if case.meta["physics"] not in PHYSICS:
        raise NotApplicable("no joint: this peer fits rigid joints with friction")
    values = dict.fromkeys(NAMES, 0.0) | {"stribeck_velocity": 0.2, "alpha": 1.35}
    return values | case.meta["stated"]


def evolve(
    case: PeerCase, free: dict[str, tuple[float, bool]], stop: int, budget: float
) -> tuple[dict[str, float], float]:
    """Return the values that CMA-ES leaves, and their mean square error on the samples before `stop`.

    free: for each fitted value its scale, and whether it is fitted by its logarithm.
    """
    base, names = start_values(case), list(free)
    torque_output = case.meta["physics"] == "sea"
    measured = case.y[:stop]

    def values_of(x):
        values = dict(base)
        for name, size in zip(names, x, strict=True):
            scale, is_log = free[name]
            values[name] = base[name] * np.exp(size) if is_log else scale * size
            if not is_log and name != "bias":
                values[name] = abs(values[name])
        return values

    def cost(x):
        p = np.array([values_of(x)[n] for n in NAMES])
        error = simulate_run(p, case.u[:stop], case.period, torque_output) - measured
        total = float(np.mean(error**2))
        return total if np.isfinite(total) else 1e30

    options = {"verbose": -9, "seed": 1, "timeout": budget, "maxfevals": 20000}
    best = cma.fmin2(cost, np.full(len(names), 0.1), SIGMA, options)[0]
    return values_of(best), cost(best)


def predict(case: PeerCase, values: dict[str, float]):
    """Return y of a run over all samples, from `split` on."""
    p = np.array([values[n] for n in NAMES])
    return simulate_run(p, case.u, case.period, case.meta["physics"] == "sea")[case.split :]
