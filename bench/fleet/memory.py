"""Peak memory of a task by the size of its recording, each in a process of its own."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

from bench import ROOT
from bench.fleet.real import knee, make_fleet
from rsea_ros.fleet.sources import bags_of
from rsea_ros.fleet.task import Task, work

LENGTHS = (10.0, 120.0, 600.0)
"""s of recordings at 280 Hz."""


def peaks() -> list[tuple[int, int]]:
    """Return bytes of a recording and bytes of memory of each length."""
    with tempfile.TemporaryDirectory(prefix="rsea-bench-") as folder:
        return [_peak(make_fleet(Path(folder) / f"{length:g}", 1, length)) for length in LENGTHS]


def _peak(bags: Path) -> tuple[int, int]:
    code = "import sys, rsea_ros.cli; from bench.fleet.memory import print_peak; print_peak(sys.argv[1])"
    command = [sys.executable, "-c", code, str(bags)]
    size, peak = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout.split()
    return int(size), int(peak)


def print_peak(folder: str) -> None:
    """Work through the one recording of a folder and print its bytes and the peak."""
    ((bag, joints),) = bags_of([folder], [knee()])
    print(bag.size, work(Task(bag, joints[0], "0" * 16, "bench")).row["peak_memory"])
