"""The torque controller on the simulated bench, faster than real time: the table of the README as Markdown.

Run: python bench/torque_control.py [RIG] [--free RIG] [--rate 280 1000].
Through real nodes: bench/torque_control_nodes.py.
"""

from __future__ import annotations

import argparse
import math
import statistics
import sys
import time
from collections.abc import Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from rsea_ros.cli.control import motors
from rsea_ros.control.controller import Reading, TorqueController
from rsea_ros.control.study import Study, study
from rsea_ros.model.rig import EffectSetting
from rsea_ros.model.rig_file import load_rig
from rsea_ros.report import control_tables as tables


def markdown(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines) + "\n"


def cost(found: Study) -> str:
    """Return what a step costs, as a part of its period, with friction compensated; medians of 1000."""
    parts = []
    rig = found.rig.with_effects(EffectSetting("coulomb_friction", {"torque": 3.0}))
    for at in found.rates:
        controller, times = TorqueController(rig, at.design.rate, at.design.gains), []
        for k in range(1000):
            reading = Reading(math.sin(0.1 * k), 0.01, 0.0, 1.0)
            begin = time.perf_counter()
            controller.step(reading, 1.0)
            times.append(time.perf_counter() - begin)
        middle = statistics.median(times)
        parts.append(f"{1e6 * middle:.0f} µs, {100 * middle * at.design.rate:.1f} % at {at.design.rate:g} Hz")
    return "One step of the controller: " + "; ".join(parts)


def main() -> None:
    """Design, try, print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("rig", nargs="?", default="paper_high_impedance")
    parser.add_argument("--free", default="paper_moving_output", help="rig whose ends are the lightest load")
    parser.add_argument("--rate", type=float, nargs="+", default=[280.0, 1000.0], help="Hz")
    args = parser.parse_args()
    rig = load_rig(args.rig)
    found = study(rig, load_rig(args.free), args.rate, motors(rig))
    rates = [f"{at.design.rate:g} Hz" for at in found.rates]
    print(*tables.gains_words(found), cost(found), sep="\n", end="\n\n")
    print(markdown(tables.trial_head(found), tables.trial_rows(found)))
    print(markdown(["compensated", "sine of 10 N·m", *rates], tables.compensation_rows(found)))
    print(markdown(["motor", "amplitude", "clamped: not from", "free: not from"], tables.reach_rows(found)))


if __name__ == "__main__":
    main()
