"""BAM's friction laws M1 to M6, each fitted by CMA-ES; the best on the last quarter stays.

Source: Duclusaud, Passault, Padois, Daney, Extended friction models for the physics simulation of servo
actuators, 2025; Rhoban/bam 1.0.2.
"""

from __future__ import annotations

import numpy as np
from common import PeerCase, PeerResult
from evolution import evolve, predict
from second_order import NAMES, simulate_run

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
SHARES = 0.9 / len(LAWS)


def fit(case: PeerCase) -> PeerResult:
    """Fit all laws, choose one."""
    begin, whole = 3 * case.split // 4, case.seconds_left
    tried = {}
    for law, names in LAWS.items():
        values, _ = evolve(case, _free(case, names), begin, SHARES * whole)
        p = np.array([values[n] for n in NAMES])
        y = simulate_run(p, case.u[: case.split], case.period, case.meta["physics"] == "sea")
        tried[law] = (float(np.mean((y - case.y[: case.split])[begin:] ** 2)), values)
    law = min(tried, key=lambda name: tried[name][0])
    values = tried[law][1]
    fitted = ("inertia", "damping", "friction", *LAWS[law])
    return PeerResult(predict(case, values), {n: values[n] for n in fitted}, f"friction {law}")


def _free(case: PeerCase, names: tuple[str, ...]) -> dict[str, tuple[float, bool]]:
    size = case.meta["torque"]
    scales = {"stribeck": 0.1 * size, "stribeck_velocity": 0.2, **dict.fromkeys(LOAD + LOAD_STRIBECK, 0.1)}
    scales |= dict.fromkeys(QUADRATIC, 0.01)
    free = {"inertia": (1.0, True), "damping": (1.0, True), "friction": (0.1 * size, False)}
    for stated in ("stiffness", "gravity"):
        free |= {stated: (1.0, True)} if case.meta["stated"].get(stated) else {}
    return free | {n: (scales[n], False) for n in names}
