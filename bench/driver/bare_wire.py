"""The wire of a simulated bench alone: lateness of its replies, and faults that the driver would latch."""

from __future__ import annotations

from itertools import groupby
from pathlib import Path

import numpy as np

from bench.driver.bare_loop import BareLoop
from rsea_ros.hardware.peer.remote import RemoteBench
from rsea_ros.nodes._devices import limits_of
from rsea_ros.nodes.driver import TABLE

ALONE = 6.0
"""s; as long as the sine of a trial."""
IN_TIME = 0.8
"""Share of a period in which a driver waits for both replies."""


def wire_alone(rate: float, priority: int, folder: Path, bench: RemoteBench) -> tuple[int, str]:
    """Run only the two requests of each cycle; return the number of faults, and a sentence about the wire."""
    cycles = BareLoop(rate, ALONE, folder, priority, bench.port).cycles()
    limit = limits_of({p.name: p.default for p in TABLE} | {"rate": rate}).lost_cycles
    late, longest, faults = outcome(cycles, rate, limit)
    told = f"{late:.1%} of the cycles late, longest {longest:.1f} ms without an answer"
    return faults, f"{told}: {faults} faults no_reply"


def outcome(cycles: np.ndarray, rate: float, limit: int) -> tuple[float, float, int]:
    """Return the share of cycles that end late, the longest wait (ms), and the waits that are a fault.

    cycles: due, begun, done of each, ns. A cycle that takes several periods stands for as many without an
    answer. limit: cycles in a row without an answer that are a fault.
    """
    periods = (cycles[:, 2] - cycles[:, 1]) * rate / 1e9
    late = periods > IN_TIME
    waits = [
        sum(max(1.0, float(np.floor(took))) for took, _ in group)
        for is_late, group in groupby(zip(periods, late, strict=True), key=lambda pair: pair[1])
        if is_late
    ]
    return float(late.mean()), float(1e3 * periods.max() / rate), sum(wait >= limit for wait in waits)
