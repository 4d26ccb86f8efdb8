"""How long the report of a fleet takes to write and its pages to open: required and measured times.

Writes the report of a simulated fleet of 10 000 recordings and of a history of `rows` rows; opens the page of
the fleet and of two joints in a headless Chromium; counts their requests to other hosts and their messages on
the console.
"""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from bench.fleet.simulated import fleet
from bench.packaging.pages import open_page
from rsea_ros.report.fleet.page import write_fleet_report


def enlarge(history: Mapping[str, np.ndarray], rows: int) -> dict[str, np.ndarray]:
    """Return a history of so many rows: its parameters again under other names."""
    copies = -(-rows // len(history["joint"]))
    out = {n: np.concatenate([c] * copies)[:rows] for n, c in history.items()}
    number = np.repeat(np.arange(copies), len(history["joint"]))[:rows]
    prefixed = np.char.add(np.char.add("copy", number.astype(str)), ".")
    out["parameter"] = np.where(number > 0, np.char.add(prefixed, out["parameter"]), out["parameter"])
    return out


def main(*, rows: int = 100_000) -> None:
    """Print the table.

    rows: of the history
    """
    made = fleet(1)
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder)
        history = enlarge(made.history, rows)
        begun, before = time.perf_counter(), time.process_time()
        write_fleet_report(history, made.recordings, out / "large")
        seconds, spent = time.perf_counter() - begun, time.process_time() - before
        load = f"{os.getloadavg()[0]:.0f} processes on {os.cpu_count()} cores"
        print(f"{'asked':<52}measured")
        print(f"{f'{rows} rows reported in <= 10 s':<52}{seconds:.1f} s ({spent:.1f} s of processor; {load})")
        write_fleet_report(made.history, made.recordings, out / "fleet")
        for name in ("index.html", "joint-J01.html", "joint-J20.html"):
            page = open_page(out / "fleet" / name)
            outside = f"{page.requests} requests, {page.errors} console messages"
            print(f"{f'{name} of 10000 bags open in <= 3 s':<52}{page.seconds:.2f} s, "
                  f"{page.figures} figures, {outside}")  # fmt: skip
