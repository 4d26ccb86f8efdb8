"""`rsea control`: gains for a rig by synthesis, their margins, and what the controlled actuator can do."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from rsea_ros.cli._output import add_force, results_place
from rsea_ros.cli._progress import progress
from rsea_ros.new_files import NewFiles

if TYPE_CHECKING:
    from rsea_ros.control.study import Motor, Study
    from rsea_ros.model.rig import Rig

HELP = "design the torque controller of a rig: gains, margins, trials in simulation, output impedance"
EXAMPLE = "rsea control paper_high_impedance --rate 280"

JSON, REPORT = "control.json", "report.html"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    parser.add_argument(
        "rig", nargs="?", default="paper_high_impedance", help="rig or model.yaml (default %(default)s)"
    )
    parser.add_argument(
        "--free",
        metavar="RIG",
        help="rig whose ends are the lightest load (default: the rig, the paper's pendulum if it is clamped)",
    )
    parser.add_argument(
        "--rate", type=float, nargs="+", default=[280.0, 1000.0], metavar="HZ", help="(default 280 1000)"
    )
    parser.add_argument(
        "--out",
        type=Path,
        help="directory for control.json and report.html (default out/control, -2, …)",
    )
    add_force(parser)
    parser.add_argument("--json", action="store_true", help="print control.json to stdout and nothing else")
    parser.add_argument("--fail-on", choices=["missed"], help="status 1 when a trial misses what is asked")


def run(args: argparse.Namespace) -> int:
    """Design, try, write the results."""
    from rsea_ros.control.loads import lightest
    from rsea_ros.control.study import study
    from rsea_ros.model.rig_file import load_rig
    from rsea_ros.report.control.json import control_json
    from rsea_ros.report.control.page import control_report
    from rsea_ros.report.json_values import json_text

    place = results_place(args, "out/control", (JSON, REPORT), [args.rig, args.free])
    _check_rates(args.rate)
    rig = load_rig(args.rig)
    with progress("control") as told:
        found = study(rig, lightest(rig, args.free or ""), args.rate, motors(rig), progress=told)
    with NewFiles(place) as new:
        path = new.write(JSON, json_text(control_json(found)))
        report = new.write(REPORT, control_report(found))
    if args.json:
        print(path.read_text(encoding="utf-8"), end="")
    else:
        _print(found, report)
    missed = any(trial.met is False for at in found.rates for trial in at.trials)
    return 1 if args.fail_on and missed else 0


def motors(rig: Rig) -> list[Motor]:
    """Return the driver's limit, and those of the catalogue's unit that has the rig's gear ratio."""
    from rsea_ros.control.controller import Limits
    from rsea_ros.control.study import Motor
    from rsea_ros.design.catalogue import catalogue

    limit, where = Limits().torque, "torque_limit of config/nodes/driver.yaml"
    found = [Motor("driver's limit", limit, float("inf"), where)]
    for unit in catalogue().values():
        if unit["ratio"] == rig["gear.ratio"]:
            speed = unit.values.get("no_load_speed", float("inf"))
            for kind in ("continuous_torque", "peak_torque"):
                if kind in unit.values:
                    name = f"{unit.name}, {kind.partition('_')[0]}"
                    found.append(Motor(name, unit[kind], speed, unit.sources[kind]))
    return found


def _check_rates(rates: list[float]) -> None:
    from rsea_ros.errors import ParameterError

    for rate in rates:
        if not 50.0 <= rate <= 10_000.0:
            raise ParameterError(f"--rate {rate:g} Hz, expected 50 to 10000 Hz")


def _print(found: Study, report: Path) -> None:
    from rich.console import Console
    from rich.table import Table

    from rsea_ros.report.control import tables

    console = Console()
    for line in tables.gains_words(found):
        console.print(line, highlight=False)
    rates = [f"{at.design.rate:g} Hz" for at in found.rates]
    blocks = [
        (tables.trial_head(found), tables.trial_rows(found)),
        (["compensated", "sine", *rates], tables.compensation_rows(found)),
        (["motor", "amplitude", "clamped: not from", "free: not from"], tables.reach_rows(found)),
    ]
    for head, rows in blocks:
        shown = Table(*head, box=None, pad_edge=False, header_style="dim")
        for row in rows:
            shown.add_row(*row)
        console.print("")
        console.print(shown, highlight=False)
    console.print(f"\nreport: {report}", highlight=False, soft_wrap=True)
