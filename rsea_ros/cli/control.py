"""`rsea control`: gains of the torque controller for a rig, their margins, and the resulting performance."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.table import Table

from rsea_ros.cli import _options, _terminal
from rsea_ros.design.motor_gear_units import catalogue
from rsea_ros.errors import ParameterError
from rsea_ros.model.rig import Rig, motor_torque
from rsea_ros.model.rig_file import load_rig
from rsea_ros.outputs.files import NewFiles
from rsea_ros.report.result_files import CONTROL_JSON, REPORT, json_text

if TYPE_CHECKING:
    from rsea_ros.control.study import MotorLimits, Study

HELP = "design the torque controller of a rig: gains, margins, trials in simulation, output impedance"
EXAMPLE = "rsea control paper_high_impedance --rate 280"
SLOWEST, FASTEST = 50.0, 2000.0
"""Hz. A sample of the controller takes about 0.2 ms of a core: faster, it would not end in time."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("rig", nargs="?", default=_options.RIG, help="rig or model.yaml (default %(default)s)")
    free = "rig whose ends are the lightest load (default: the rig; the paper's pendulum if it is clamped)"
    add("--free", metavar="RIG", help=free)
    wide = "YAML of what to tolerate: spread, lag, mode (default: from the rig; docs/control.md)"
    add("--uncertainty", metavar="FILE", help=wide)
    rates = "rates of the control loop, Hz (default 280 1000)"
    add("--rate", type=float, nargs="+", default=[280.0, 1000.0], metavar="HZ", help=rates)
    _options.add_results(parser, f"{CONTROL_JSON} and {REPORT}", "out/control")
    _options.add_json(parser, CONTROL_JSON)
    parser.add_argument("--fail-on", choices=["missed"], help="exit status 1 if a trial misses its limit")


def run(args: argparse.Namespace) -> int:
    from rsea_ros.control.study import study
    from rsea_ros.control.uncertainty import lightest, load_uncertainty
    from rsea_ros.report import control as page

    inputs = [args.rig, args.free, args.uncertainty]
    place = _options.results_place(args, "out/control", (CONTROL_JSON, REPORT), inputs)
    for rate in args.rate:
        if not SLOWEST <= rate <= FASTEST:
            raise ParameterError(f"--rate {rate:g} Hz, expected {SLOWEST:g} to {FASTEST:g} Hz")
    rig = load_rig(args.rig)
    file = args.uncertainty
    stated = [load_uncertainty(file, rig, rate) if file else None for rate in args.rate]
    with _terminal.progress("control") as report_progress:
        light = lightest(rig, args.free or "")
        result = study(rig, light, args.rate, motors(rig), progress=report_progress, sets=stated)
    source = _options.provenance("control", [], args.rig)
    with NewFiles(place) as new:
        path = new.write(CONTROL_JSON, json_text(page.control_json(result)))
        report = new.write(REPORT, page.control_report(result, source))
    if args.json:
        _options.print_file(path)
    else:
        _print(result, report)
    missed = any(trial.met is False for at in result.rates for trial in at.trials)
    return 1 if args.fail_on and missed else 0


def motors(rig: Rig) -> list[MotorLimits]:
    """Return the limit of the driver, and those of the catalogue unit with the gear ratio of the rig."""
    from rsea_ros.control.study import MotorLimits

    limit, where = motor_torque(rig)
    limits = [MotorLimits("driver's limit", limit, float("inf"), where)]
    for unit in catalogue().values():
        if unit["ratio"] == rig["gear.ratio"]:
            speed = unit.values.get("no_load_speed", float("inf"))
            for kind in ("continuous_torque", "peak_torque"):
                if kind in unit.values:
                    name = f"{unit.name}, {kind.partition('_')[0]}"
                    limits.append(MotorLimits(name, unit[kind], speed, unit.sources[kind]))
    return limits


def _print(result: Study, report: Path) -> None:
    from rsea_ros.report import control as page

    console = Console()
    for line in page.gains_words(result):
        console.print(line, highlight=False)
    rates = page.rates(result)
    blocks = [
        (["trial", "required", *rates], page.trial_rows(result)),
        (["compensated", "sine", *rates], page.compensation_rows(result)),
        (page.REACH_HEAD, page.reach_rows(result)),
    ]
    for head, rows in blocks:
        shown = Table(*head, box=None, pad_edge=False, header_style="dim")
        for row in rows:
            shown.add_row(*row)
        console.print("")
        console.print(shown, highlight=False)
    console.print(f"\nreport: {report}", highlight=False, soft_wrap=True)
