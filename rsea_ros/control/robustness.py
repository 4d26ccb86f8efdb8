"""The whole set of benches, swept: the worst of every margin, and the case that has it.

No structured singular value: a dense grid of the sampled loop is exact at its points, and counts the delay
and the mode exactly (python-control's mu needs slycot, which is not installed, and a rational delay).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from rsea_ros.control.law import law_of
from rsea_ros.control.loop import returns
from rsea_ros.control.margins import Margins, encirclements, least, margins
from rsea_ros.control.synthesis import ControllerDesign, grid
from rsea_ros.control.uncertainty import BenchVariant, Uncertainty, dense, family
from rsea_ros.model.rig import Rig


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
    u, hz, law = u or Uncertainty(), grid(designed.rate), law_of(rig, designed.rate, designed.gains)
    total = unstable = 0
    worst, where, every = 0.0, BenchVariant(""), []
    for name in loads:
        f = family(loads, dense((name,), u, steps), u, designed.rate, hz)
        memory, whole = returns(law, f.plant, hz, f.path, f.current)
        wound = encirclements(whole)
        total, unstable = total + len(f.cases), unstable + int(np.count_nonzero(wound > 0.5))
        peaks = (np.maximum(np.abs(memory), 1.0) / np.abs(whole)).max(axis=1)
        if peaks.max() > worst:
            worst, where = float(peaks.max()), f.cases[int(np.argmax(peaks))]
        every += [margins(row, hz, 1.0 / designed.rate) for row in whole / memory - 1.0]
    return Robustness(total, unstable, worst, where, least(every))
