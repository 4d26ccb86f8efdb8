"""The F/T stream at 7 kHz: how old the newest record is, and whether every loss is counted."""

from __future__ import annotations

import argparse
import math
import time
from pathlib import Path

import numpy as np

from bench.driver_loop import Loop
from rsea_ros.hardware.peer.remote import RemoteBench


def stream(args: argparse.Namespace, folder: Path) -> list[tuple[str, str, str]]:
    """Measure at 280 Hz and 1 kHz, with 0.1 % of the records left out."""
    rows = []
    for rate in (280.0, 1000.0):
        with RemoteBench(folder / f"tty{rate:g}", "--ft-rate", 7000) as bench:
            loop = Loop(bench, rate, lost_cycles=100, ft_timeout=1.0)
            before = bench.log(time.monotonic_ns())["ft_gone"]
            lost = int(loop.device.health().get("ft_lost", 0))
            bench.ask("misbehave", ft_drop=0.001)
            ages = _ages(loop, rate, args.seconds)
            bench.ask("misbehave", ft_drop=0.0)
            time.sleep(0.1)
            gone = bench.log(time.monotonic_ns())["ft_gone"] - before
            loop.cycle(0.0)
            counted = int(loop.device.health().get("ft_lost", 0)) - lost
            loop.device.close()
        cycles = ages * rate / 1e9
        rows += [
            (f"{rate:g} Hz: age of the newest record", "≤ 2 cycles",
             f"p99 {np.quantile(cycles, 0.99):.2f}, most {cycles.max():.2f} cycles;"
             f" {(cycles > 2).sum()} of {len(cycles)} older"),
            (f"{rate:g} Hz: records lost", "counted exactly", f"{counted} counted, {gone} left out"),
        ]  # fmt: skip
    return rows


def _ages(loop: Loop, rate: float, seconds: float) -> np.ndarray:
    """Return the age (ns) of the newest record at the end of each cycle."""
    ages, newest = [], math.inf
    for _ in range(round(rate * seconds)):
        state = loop.cycle(0.0)
        if state is not None:
            newest = state.ft_stamp or newest
            ages.append(state.stamp - newest)
    return np.array([a for a in ages if math.isfinite(a)])
