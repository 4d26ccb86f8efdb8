"""`rsea design`: from torque, bandwidth and inertia to spring stiffness and spring rate."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import Any

from rsea_ros.cli._output import add_force, results_place
from rsea_ros.design.requirement import Requirement, check_magnitude
from rsea_ros.model.train import TRAINS
from rsea_ros.new_files import NewFiles

HELP = "the paper's design method: torque, bandwidth and inertia to stiffness and spring rate"
EXAMPLE = "rsea design --torque 200 --bandwidth 50 --inertia 0.01"
JSON, REPORT = "design.json", "report.html"
UNIT, STIFFNESS = "rd85x13-hd_cpl-25a-160", 260.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments; the defaults are the paper's example."""
    default = Requirement()
    parser.add_argument("--torque", type=float, default=default.torque, help="N m (default %(default)s)")
    parser.add_argument("--bandwidth", type=float, default=default.bandwidth, help="Hz (default %(default)s)")
    parser.add_argument(
        "--inertia",
        type=float,
        default=default.inertia,
        help="of the spring chassis, kg m^2 (default %(default)s)",
    )
    parser.add_argument(
        "--mass", type=float, default=default.mass, help="of the chassis, kg (default %(default)s)"
    )
    parser.add_argument(
        "--diameter", type=float, default=default.diameter, help="of the chassis, m (default %(default)s)"
    )
    parser.add_argument(
        "--separation",
        type=float,
        default=default.separation,
        help="between two springs, m (default %(default)s)",
    )
    parser.add_argument(
        "--spring-radius",
        type=float,
        default=default.spring_radius,
        help="r_s of Eq. (9), m (default %(default)s)",
    )
    parser.add_argument(
        "--deflection",
        type=float,
        default=math.degrees(default.deflection),
        help="largest, deg (default %(default).3g)",
    )
    parser.add_argument(
        "--tolerance-db",
        type=float,
        default=default.tolerance_db,
        help="of |T_d/T_p|, dB (default %(default)s)",
    )
    parser.add_argument(
        "--tolerance-deg",
        type=float,
        default=default.tolerance_deg,
        help="of its phase, deg; 90: any (default %(default)s)",
    )
    parser.add_argument(
        "--stiffness",
        type=float,
        default=STIFFNESS,
        help="to be judged, N m/rad (default %(default)s, the paper's)",
    )
    parser.add_argument("--unit", default=UNIT, help="motor and gear of the catalogue (default %(default)s)")
    parser.add_argument(
        "--train", choices=TRAINS, help="of the gear, where the unit's own is another (default: the unit's)"
    )
    parser.add_argument(
        "--catalogue",
        type=Path,
        help="YAML of motor-gear units (default config/design/motor_gear_units.yaml)",
    )
    parser.add_argument(
        "--out",
        type=Path,
        help="directory for design.json and report.html (default out/design, -2, …)",
    )
    add_force(parser)
    parser.add_argument("--json", action="store_true", help="print design.json to stdout and nothing else")
    parser.add_argument("--fail-on", choices=["unmet"], help="status 1 when the stiffness misses a demand")


def run(args: argparse.Namespace) -> int:
    """Judge the stiffness, find those that meet all demands, write the results."""
    from rsea_ros.design.catalogue import unit_named
    from rsea_ros.design.judge import judge, least_stiffness
    from rsea_ros.design.margins import robust_stiffness
    from rsea_ros.report.design.json import design_json
    from rsea_ros.report.design.page import design_report
    from rsea_ros.report.json_values import json_text

    place = results_place(args, "out/design", (JSON, REPORT), [args.catalogue])
    check_magnitude("stiffness", args.stiffness, "N m/rad")
    requirement, unit = _requirement(args), unit_named(args.unit, args.catalogue)
    unit = unit.with_train(args.train) if args.train else unit
    asked = judge(requirement, unit, args.stiffness)
    least = judge(requirement, unit, least_stiffness(requirement, unit))
    enough = robust_stiffness(requirement, unit)
    robust = judge(requirement, unit, enough) if math.isfinite(enough) else None
    with NewFiles(place) as new:
        path = new.write(JSON, json_text(design_json(asked, least, robust)))
        report = new.write(REPORT, design_report(asked, least, robust))
    if args.json:
        print(path.read_text(encoding="utf-8"), end="")
    else:
        _print(asked, least, robust, report)
    return 1 if args.fail_on and not asked.feasible else 0


def _requirement(args: argparse.Namespace) -> Requirement:
    names = (
        "torque",
        "bandwidth",
        "inertia",
        "mass",
        "diameter",
        "separation",
        "spring_radius",
        "tolerance_db",
        "tolerance_deg",
    )
    return Requirement(deflection=math.radians(args.deflection), **{n: getattr(args, n) for n in names})


def _print(asked: Any, least: Any, robust: Any, report: Path) -> None:
    from rsea_ros.design.by_train import by_train
    from rsea_ros.report import words
    from rsea_ros.report.design.page import verdict

    print(verdict(asked))
    for check in asked.checks:
        value = "not possible" if math.isnan(check.value) else f"{check.value:.4g} {check.unit}"
        sign = ">=" if check.least else "<="
        print(
            f"  {'yes' if check.met else 'NO '}  {check.name}: {value}, asked {sign} {check.limit:.4g} "
            f"{check.unit}"
        )
    print(
        f"least stiffness that meets all demands on the spring: {least.stiffness:.0f} N m/rad, springs of "
        f"{least.rate:.0f} N/m"
    )
    for row in by_train(asked.requirement, asked.unit, asked.stiffness):
        low, high = row.band_range
        print(
            f"  {words.train(row.train)}, n = {row.turns:+.0f}: {row.band:.4g} Hz "
            f"({low:.4g} to {high:.4g} Hz over 90 % of the rotor's inertia), {row.for_band:.0f} N m/rad for "
            f"{asked.requirement.bandwidth:g} Hz, {row.least:.0f} N m/rad for all demands"
        )
    if robust:
        print(f"with 95 % of all parts within tolerance: {robust.stiffness:.0f} N m/rad")
    print(f"report: {report}")
