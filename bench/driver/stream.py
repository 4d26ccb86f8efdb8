"""The F/T stream at 7 kHz: how old the newest record is, and whether every loss is counted."""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np

from bench.driver.loop import Loop
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
            ages, ready = _ages(loop, rate, args.seconds)
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
             f" {(cycles > 2).sum()} of {len(cycles)} older, {(cycles[ready] > 2).sum()} beside a newer one"),
            (f"{rate:g} Hz: records lost", "counted exactly", f"{counted} counted, {gone} left out"),
        ]  # fmt: skip
    return rows


def _ages(loop: Loop, rate: float, seconds: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the age (ns) of the newest record at the end of each cycle, and whether there was a newer one.

    That is one that had arrived by then, as its stamp shows when it is taken: else the bench sent none.
    """
    ends, newest, stamps = [], [], [0]
    for _ in range(round(rate * seconds)):
        state = loop.cycle(0.0)
        if state is not None:
            stamps += [stamp for stamp, _ in state.wrenches]
            ends.append(state.stamp)
            newest.append(stamps[-1])
    taken, arrived, begun = np.array(newest), np.array(stamps), newest.count(0)
    has_arrived = np.searchsorted(arrived, ends) > np.searchsorted(arrived, newest) + 1
    return (np.array(ends) - taken)[begun:], has_arrived[begun:]
