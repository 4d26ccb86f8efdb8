"""Time of `rsea identify` on 160 s, three topics at 280 Hz, beside a plain scipy response of the same arrays.

Run: python bench/identify.py [--repeat 7] [--duration 60]. Medians; ratios do not depend on the machine,
milliseconds do. The verb starts with modules compiled before, as on a user's machine.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.signal import csd, welch

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from msg_adapters import read_record, write_record
from rsea_ros.identification.excitation import ExcitationSettings, excitation
from rsea_ros.identification.identify import identify
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import synthesize
from rsea_ros.records.record import Channel, Record

ROOT = Path(__file__).resolve().parents[1]
RATE, DURATION = 280.0, 160.0
OFF = 1.08
"""True values over those of the rig: a fit that starts at the truth would be too quick."""


def bench_record(duration: float = DURATION) -> Record:
    """Return the paper's run on a bench whose values differ from the rig's."""
    rig = load_rig("paper_high_impedance")
    true = rig.with_values({n: rig[n] * OFF for n in rig.free()})
    u = excitation("chirp", ExcitationSettings(rate=RATE, duration=duration))
    return synthesize(true, Channel(np.arange(len(u)) / RATE, u), seed=1)


def plain_response(record: Record) -> None:
    """Estimate responses as a script does: H1 by Welch of F/T torque and position to the command."""
    u = record["command"].y
    for name in ("ft", "position"):
        _, s_uy = csd(u, record[name].y, RATE, nperseg=4096)
        _, s_uu = welch(u, RATE, nperseg=4096)
        s_uy / s_uu


def times_ms(work: Callable[[], object], repeat: int) -> tuple[float, float]:
    """Return median and least time of some work, ms, after one run that is not counted."""
    work()
    times = []
    for _ in range(repeat):
        begin = time.perf_counter()
        work()
        times.append(1e3 * (time.perf_counter() - begin))
    return statistics.median(times), min(times)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeat", type=int, default=7, help="runs of each, of which the median counts")
    parser.add_argument("--duration", type=float, default=DURATION, help="of the record, s (default 160)")
    args = parser.parse_args()
    record, rig = bench_record(args.duration), load_rig("paper_high_impedance")
    with tempfile.TemporaryDirectory() as folder:
        bag = Path(folder) / "bag"
        write_record(record, bag)
        verb = [sys.executable, "-m", "rsea_ros", "identify"]
        command = [*verb, str(bag), "--out", f"{folder}/out", "--force"]
        kept = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
        environment = {**kept, "PYTHONPYCACHEPREFIX": f"{folder}/compiled"}
        rows: dict[str, Callable[[], object]] = {
            "scipy: csd and welch, two channels": lambda: plain_response(record),
            "read the bag": lambda: read_record(bag),
            "responses and fit (identify)": lambda: identify([record], rig),
            "rsea identify, start to end": lambda: subprocess.run(
                command, cwd=ROOT, check=True, capture_output=True, env=environment
            ),
        }
        print(f"{args.duration:g} s, {len(record['command'])} samples a topic, three topics")
        print(f"{'':36}{'median ms':>10}{'least ms':>10}{'/ scipy':>9}")
        plain = 0.0
        for name, work in rows.items():
            median, least = times_ms(work, args.repeat)
            plain = plain or median
            print(f"{name:36}{median:10.0f}{least:10.0f}{median / plain:9.1f}")


if __name__ == "__main__":
    main()
