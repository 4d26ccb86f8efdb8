"""What |Z| at most 1.2 costs where the whole set must keep it: the gains searched anew for several limits.

The design keeps the limit for the rig itself. Here every locked bench of the set's corners must keep it.
`none`: the smallest worst case that any gains of the law reach with the sensitivities demanded.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from scipy.optimize import minimize

from rsea_ros.control import synthesis
from rsea_ros.control.impedance import Moved, distal_responses, moved_bench
from rsea_ros.control.law import Gains, law_of
from rsea_ros.control.loads import LOCKED, load_range
from rsea_ros.control.synthesis import DesignLimits, check, design, grid
from rsea_ros.control.uncertainty import Uncertainty, corners
from rsea_ros.model.rig import Rig

LIMITS = (1.3, 1.2, None)
STARTS = ((0.1, 0.0005, 0.4, 5.0, 60.0), (0.1, 0.0002, 0.5, 2.0, 70.0))
"""k_p, k_d, k_i, q_frequency, k_w: a well damped motor."""
POINTS, EVALUATIONS = 60, 250


def stiffest(rig: Rig, free: Rig, rates: Sequence[float]) -> Iterator[str]:
    """Search the gains with the worst impedance of the set limited."""
    loads = load_range(rig, free)
    for rate in rates:
        set_of = _set(rig, rate)
        gains = {"1.2 for the rig": design(rig, loads, rate).gains}
        for limit in LIMITS:
            gains[f"{limit or 'none'} for the set"] = _limit(rig, loads, rate, set_of, limit)
        for name, each in gains.items():
            yield f"{rate:g} Hz, {name}: {_row(rig, loads, rate, set_of, each)}"


def _set(rig: Rig, rate: float) -> list[Moved]:
    u = Uncertainty()
    return [moved_bench(rig, rate, grid(rate, POINTS), case, u) for case in corners((LOCKED,), u)]


def _worst(rig: Rig, rate: float, set_of: Sequence[Moved], gains: Gains) -> float:
    law = law_of(rig, rate, gains)
    return max(float(bench.ratio(law).max()) for bench in set_of)


def _limit(
    rig: Rig, loads: Mapping[str, Rig], rate: float, set_of: Sequence[Moved], limit: float | None
) -> Gains:
    """Return the best gains with the worst of the set limited; None: those with the smallest worst."""
    few = {name: load for name, load in loads.items() if not name.endswith(synthesis.HEAVY)}
    problem = synthesis._problem(rig, few, rate, grid(rate, POINTS))

    def cost(x: np.ndarray) -> float:
        gains = synthesis._gains(x, rate)
        score, worst = synthesis._score(problem, gains), _worst(rig, rate, set_of, gains)
        beyond = 20.0 * synthesis._shortfall(problem, score, DesignLimits())
        if limit is None:
            return float(np.log(worst)) + beyond
        soft = np.interp(synthesis.SOFT, problem.moved.hz, score.softness)
        aim = np.log(score.friction.max()) + np.mean(np.log(soft))
        return float(aim) + beyond + 20.0 * max(0.0, worst / limit - 1.0)

    options = {"maxfev": EVALUATIONS, "xatol": 1e-3, "fatol": 1e-4, "adaptive": True}
    ends = [minimize(cost, np.log(start), method="Nelder-Mead", options=options) for start in STARTS]
    ends += [minimize(cost, end.x, method="Nelder-Mead", options=options) for end in ends]
    return synthesis._gains(min(ends, key=lambda end: end.fun).x, rate)


def _row(rig: Rig, loads: Mapping[str, Rig], rate: float, set_of: Sequence[Moved], gains: Gains) -> str:
    margins = check(rig, loads, rate, gains)
    soft = distal_responses(rig, rate, np.array(synthesis.SOFT)).ratio(law_of(rig, rate, gains))
    at = ", ".join(f"{hz:g} Hz {ratio:.3f}" for hz, ratio in zip(synthesis.SOFT, soft, strict=True))
    worst = _worst(rig, rate, set_of, gains)
    return (
        f"|Z| over the spring's at most {margins.impedance:.2f}, worst of the set {worst:.2f}; at {at}; "
        f"friction left {margins.friction_left:.2f} N·m per N·m; |S| {margins.sensitivity:.2f}; {gains}"
    )
