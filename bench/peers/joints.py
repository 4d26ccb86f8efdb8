"""Peers that fit the joint of second_order.py by CMA-ES, as BAM and PACE fit theirs.

bam: BAM's friction laws M1 to M6; the best on the last quarter stays. Source: Duclusaud, Passault, Padois,
Daney, Extended friction models for the physics simulation of servo actuators, 2025; Rhoban/bam 1.0.2.
cma_pace: the five values that PACE fits for a joint: armature, viscous and dry friction, bias, and one delay.
Source: leggedrobotics/pace-sim2real. All else, such as the stiffness of a spring, stays as stated.
"""

import cma
import numpy as np
from common import NotApplicable, PeerCase, PeerResult
from second_order import NAMES, simulate_run

SIGMA = 0.3
"""First step, in units of a value's scale."""
STRIBECK = ("stribeck", "stribeck_velocity")
LOAD = ("load_motor", "load_external")
LOAD_STRIBECK = ("load_motor_stribeck", "load_external_stribeck")
QUADRATIC = ("quadratic_motor", "quadratic_external")
LAWS = {
    "M1": (),
    "M2": STRIBECK,
    "M3": LOAD,
    "M4": (*STRIBECK, *LOAD),
    "M5": (*STRIBECK, *LOAD, *LOAD_STRIBECK),
    "M6": (*STRIBECK, *LOAD, *LOAD_STRIBECK, *QUADRATIC),
}
"""M3 and M4 tie the two loads of BAM to one coefficient; here they are two, as in M5."""
Values = dict[str, float]
Scales = dict[str, tuple[float, bool]]
"""By value: its scale, and whether it is fitted by its logarithm."""


def bam(case: PeerCase) -> PeerResult:
    """Fit all laws, choose one."""
    begin, share, size = 3 * case.split // 4, 0.9 / len(LAWS) * case.seconds_left, case.meta["torque"]
    scales = {"stribeck": 0.1 * size, "stribeck_velocity": 0.2, **dict.fromkeys(LOAD + LOAD_STRIBECK, 0.1)}
    scales |= dict.fromkeys(QUADRATIC, 0.01)
    free = _usual(case)
    for stated in ("stiffness", "gravity"):
        free |= {stated: (1.0, True)} if case.meta["stated"].get(stated) else {}
    tried = {}
    for law, names in LAWS.items():
        values = _evolved(case, free | {n: (scales[n], False) for n in names}, begin, share)
        error = (_run(case, values, case.split) - case.y[: case.split])[begin:]
        tried[law] = (float(np.mean(error**2)), values)
    law = min(tried, key=lambda name: tried[name][0])
    values, fitted = tried[law][1], ("inertia", "damping", "friction", *LAWS[law])
    return PeerResult(_run(case, values)[case.split :], {n: values[n] for n in fitted}, f"friction {law}")


def cma_pace(case: PeerCase) -> PeerResult:
    """Fit the five values."""
    free = _usual(case) | {"delay": (5e-3, False), "bias": (case.meta["bias"], False)}
    values = _evolved(case, free, case.split, 0.9 * case.seconds_left)
    shown = {n: values[n] for n in ("inertia", "damping", "friction", "delay")}
    return PeerResult(_run(case, values)[case.split :], shown)


def _usual(case: PeerCase) -> Scales:
    return {"inertia": (1.0, True), "damping": (1.0, True), "friction": (0.1 * case.meta["torque"], False)}


def _run(case: PeerCase, values: Values, stop: int | None = None):
    """Return y of a run over the samples before `stop`."""
    p = np.array([values[n] for n in NAMES])
    return simulate_run(p, case.u[:stop], case.period, case.meta["physics"] == "sea")


def _evolved(case: PeerCase, free: Scales, stop: int, budget: float) -> Values:
    """Return the values that CMA-ES leaves on the samples before `stop`. Raises NotApplicable."""
    if case.meta["physics"] not in ("sea", "joint", "drive"):
        raise NotApplicable("no joint: this peer fits rigid joints with friction")
    base = dict.fromkeys(NAMES, 0.0) | {"stribeck_velocity": 0.2, "alpha": 1.35} | case.meta["stated"]

    def values_of(x):
        values = dict(base)
        for (name, (scale, is_log)), size in zip(free.items(), x, strict=True):
            values[name] = base[name] * np.exp(size) if is_log else scale * size
            if not is_log and name != "bias":
                values[name] = abs(values[name])
        return values

    def cost(x):
        total = float(np.mean((_run(case, values_of(x), stop) - case.y[:stop]) ** 2))
        return total if np.isfinite(total) else 1e30

    options = {"verbose": -9, "seed": 1, "timeout": budget, "maxfevals": 20000}
    return values_of(cma.fmin2(cost, np.full(len(free), 0.1), SIGMA, options)[0])
