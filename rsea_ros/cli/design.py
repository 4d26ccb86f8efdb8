"""`rsea design`: from torque, bandwidth and inertia to spring stiffness and spring rate."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import Any

from rsea_ros.cli._output import add_json, add_results, path, print_file, results_place
from rsea_ros.cli._terminal import say
from rsea_ros.design.requirement import Requirement, check_magnitude
from rsea_ros.model.train import TRAINS
from rsea_ros.outputs.new_files import NewFiles
from rsea_ros.report.result_files import DESIGN_JSON, REPORT

HELP = "compute spring stiffness and spring rate from torque, bandwidth and inertia by the paper's method"
EXAMPLE = "rsea design --torque 200 --bandwidth 50 --inertia 0.01"
SIZES = {
    "torque": "largest torque, N·m",
    "bandwidth": "bandwidth, Hz",
    "inertia": "inertia of the spring chassis, kg·m²",
    "mass": "mass of the chassis, kg",
    "diameter": "diameter of the chassis, m",
    "separation": "distance between two springs, m",
    "spring_radius": "radius r_s of Eq. (9), m",
}
TOLERANCES = {
    "tolerance_db": "tolerance of |T_d/T_p|, dB",
    "tolerance_deg": "tolerance of its phase, deg; 90: none",
}
UNIT, STIFFNESS = "rd85x13-hd_cpl-25a-160", 260.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments; the defaults are the paper's example."""
    default = Requirement()
    for name in SIZES:
        _add_demand(parser, default, name)
    parser.add_argument(
        "--deflection",
        type=float,
        default=math.degrees(default.deflection),
        help="largest deflection, deg (default %(default).3g)",
    )
    for name in TOLERANCES:
        _add_demand(parser, default, name)
    parser.add_argument(
        "--stiffness",
        type=float,
        default=STIFFNESS,
        help="stiffness to test, N·m/rad (default %(default)s, the paper's)",
    )
    parser.add_argument("--unit", default=UNIT, help="motor-gear unit of the catalogue (default %(default)s)")
    parser.add_argument("--train", choices=TRAINS, help="gear train, if it differs from that of the unit")
    parser.add_argument(
        "--catalogue",
        type=path,
        help="YAML of motor-gear units (default config/design/motor_gear_units.yaml)",
    )
    add_results(parser, f"{DESIGN_JSON} and {REPORT}", "out/design")
    add_json(parser, DESIGN_JSON)
    parser.add_argument("--fail-on", choices=["unmet"], help="exit status 1 if the stiffness misses a demand")


def _add_demand(parser: argparse.ArgumentParser, default: Requirement, name: str) -> None:
    about = {**SIZES, **TOLERANCES}[name]
    parser.add_argument(
        f"--{name.replace('_', '-')}",
        type=float,
        default=getattr(default, name),
        help=f"{about} (default %(default)s)",
    )


def run(args: argparse.Namespace) -> int:
    """Test the stiffness, find the stiffnesses that meet all demands, write the results."""
    from rsea_ros.cli._output import provenance
    from rsea_ros.design.motor_gear_units import unit_named
    from rsea_ros.design.spring_design import least_stiffness, spring_design
    from rsea_ros.design.tolerance import robust_stiffness
    from rsea_ros.report.design.page import design_report
    from rsea_ros.report.design.tables import design_json
    from rsea_ros.report.result_files import json_text

    place = results_place(args, "out/design", (DESIGN_JSON, REPORT), [args.catalogue])
    check_magnitude("stiffness", args.stiffness, "N m/rad")
    requirement, unit = _requirement(args), unit_named(args.unit, args.catalogue)
    unit = unit.with_train(args.train) if args.train else unit
    asked = spring_design(requirement, unit, args.stiffness)
    least = spring_design(requirement, unit, least_stiffness(requirement, unit))
    enough = robust_stiffness(requirement, unit)
    robust = spring_design(requirement, unit, enough) if math.isfinite(enough) else None
    source = provenance("design", [args.catalogue] if args.catalogue else [])
    with NewFiles(place) as new:
        path = new.write(DESIGN_JSON, json_text(design_json(asked, least, robust)))
        report = new.write(REPORT, design_report(asked, least, robust, source))
    if args.json:
        print_file(path)
    else:
        _print(asked, least, robust, report)
    return 1 if args.fail_on and not asked.feasible else 0


def _requirement(args: argparse.Namespace) -> Requirement:
    values = {name: getattr(args, name) for name in (*SIZES, *TOLERANCES)}
    return Requirement(deflection=math.radians(args.deflection), **values)


def _print(asked: Any, least: Any, robust: Any, report: Path) -> None:
    from rsea_ros.design.spring_design import by_train
    from rsea_ros.report import words
    from rsea_ros.report.design.page import verdict

    say(verdict(asked))
    for check in asked.checks:
        value = "not possible" if math.isnan(check.value) else f"{check.value:.4g} {words.unit(check.unit)}"
        sign = ">=" if check.least else "<="
        say(
            f"  {'yes' if check.met else 'NO '}  {check.name}: {value}, required {sign} {check.limit:.4g} "
            f"{words.unit(check.unit)}",
            indent=7,
        )
    say(
        f"smallest stiffness that meets all demands on the spring: {least.stiffness:.0f} N·m/rad, springs of "
        f"{least.rate:.0f} N/m"
    )
    for row in by_train(asked.requirement, asked.unit, asked.stiffness):
        low, high = row.band_range
        say(
            f"  {words.train(row.train)}, n = {row.turns:+.0f}: {row.band:.4g} Hz "
            f"({low:.4g} to {high:.4g} Hz over 90 % of the rotor's inertia), {row.for_band:.0f} N·m/rad for "
            f"{asked.requirement.bandwidth:g} Hz, {row.least:.0f} N·m/rad for all demands",
            indent=4,
        )
    if robust:
        print(f"with 95 % of all parts within tolerance: {robust.stiffness:.0f} N·m/rad")
    print(f"report: {report}")
