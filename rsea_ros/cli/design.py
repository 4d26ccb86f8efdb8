"""`rsea design`: from torque, bandwidth and inertia to spring stiffness and spring rate."""

import argparse
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

from rsea_ros.cli import _options, _terminal
from rsea_ros.design.mechanism import UNITS, Requirement
from rsea_ros.design.motor_gear_units import PAPERS, unit_named
from rsea_ros.model.train import PARTS, TRAINS
from rsea_ros.outputs.files import NewFiles
from rsea_ros.report import words
from rsea_ros.report.result_files import DESIGN_JSON, REPORT, json_text

HELP = "compute spring stiffness and spring rate from torque, bandwidth and inertia by the paper's method"
EXAMPLE = "rsea design --torque 200 --bandwidth 50 --inertia 0.01"
DEMANDS = {
    "torque": "largest torque, N·m (default %(default)s)",
    "bandwidth": "bandwidth, Hz (default %(default)s)",
    "inertia": "inertia of the part beside the spring, kg·m² (default %(default)s)",
    "mass": "mass of the chassis, kg (default %(default)s)",
    "diameter": "diameter of the chassis, m (default %(default)s)",
    "separation": "distance between two springs, m (default %(default)s)",
    "spring_radius": "radius r_s of Eq. (9), m (default %(default)s)",
    "deflection": "largest deflection, deg (default %(default).3g)",
    "tolerance_db": "tolerance of |T_d/T_p|, dB (default %(default)s)",
    "tolerance_deg": "tolerance of its phase, deg; 90: none (default %(default)s)",
}
STIFFNESS = 260.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments; the defaults are the paper's example."""
    add, default = parser.add_argument, Requirement()
    example = {**vars(default), "deflection": math.degrees(default.deflection)}
    for name, about in DEMANDS.items():
        add(f"--{name.replace('_', '-')}", type=float, default=example[name], help=about)
    about = f"stiffness to test, N·m/rad (default: the least for your demands; the paper's: {STIFFNESS:g})"
    add("--stiffness", type=float, help=about)
    add("--unit", default=PAPERS, help="motor-gear unit of the catalogue (default %(default)s)")
    add("--train", choices=TRAINS, help="gear train, if it differs from that of the unit")
    about = "the part beside the spring; housing: held by the gear output, an RT-RSEA (default %(default)s)"
    add("--beside-spring", choices=PARTS, default=PARTS[0], help=about)
    about = "YAML of motor-gear units (default config/design/motor_gear_units.yaml)"
    add("--catalogue", type=_options.path, help=about)
    _options.add_results(parser, f"{DESIGN_JSON} and {REPORT}", "out/design")
    _options.add_json(parser, DESIGN_JSON)
    add("--fail-on", choices=["unmet"], help="exit status 1 if the stiffness misses a demand")


def run(args: argparse.Namespace) -> int:
    from rsea_ros.design import spring_design as springs
    from rsea_ros.report import design as page

    place = _options.results_place(args, "out/design", (DESIGN_JSON, REPORT), [args.catalogue])
    values = {name: getattr(args, name) for name in DEMANDS}
    requirement = Requirement(**{**values, "deflection": math.radians(args.deflection)})
    unit = unit_named(args.unit, args.catalogue)
    unit = unit.with_train(args.train) if args.train else unit
    unit = replace(unit, beside_spring=args.beside_spring)
    least = springs.spring_design(requirement, unit, springs.least_stiffness(requirement, unit))
    asked = least
    stated = STIFFNESS if args.stiffness is None and requirement == Requirement() else args.stiffness
    if stated is not None:
        asked = springs.spring_design(requirement, unit, stated)
    enough = springs.robust_stiffness(requirement, unit)
    robust = springs.spring_design(requirement, unit, enough) if math.isfinite(enough) else None
    source = _options.provenance("design", [args.catalogue] if args.catalogue else [])
    with NewFiles(place) as new:
        path = new.write(DESIGN_JSON, json_text(page.design_json(asked, least, robust)))
        report = new.write(REPORT, page.design_report(asked, least, robust, source))
    if args.json:
        _options.print_file(path)
    else:
        _print(asked, least, robust, report)
    return 1 if args.fail_on and not asked.feasible else 0


def unstated(d: Any) -> str:
    """Return what nobody stated, with its value: demands that are the paper's, motor and gear."""
    mine, papers = vars(d.requirement), vars(Requirement())
    values = {n: (v, words.unit(UNITS[n])) for n, v in mine.items() if v == papers[n]}
    if "deflection" in values:
        values["deflection"] = math.degrees(d.requirement.deflection), "°"
    parts = [f"{name.replace('_', ' ')} {value:.3g} {unit}" for name, (value, unit) in values.items()]
    return ", ".join([*parts, *(["motor and gear"] if d.unit.name == PAPERS else [])])


def _print(asked: Any, least: Any, robust: Any, report: Path) -> None:
    from rsea_ros.design.spring_design import by_train
    from rsea_ros.report.design import verdict, whole

    _terminal.say(verdict(asked))
    for check in asked.checks:
        value = "not possible" if math.isnan(check.value) else f"{check.value:.4g} {words.unit(check.unit)}"
        sign = ">=" if check.least else "<="
        limit = f"required {sign} {check.limit:.4g} {words.unit(check.unit)}"
        _terminal.say(f"  {'yes' if check.met else 'NO '}  {check.name}: {value}, {limit}", indent=7)
    rate = f"springs of {least.rate:.0f} N/m"
    if asked is least:
        _terminal.say(f"no softer spring meets them: {rate}")
    else:
        smallest = f"{whole(least.stiffness)} N·m/rad, {rate}"
        _terminal.say(f"smallest stiffness that meets all demands on the spring: {smallest}")
    if papers := unstated(asked):
        _terminal.say(f"not stated, so the paper's: {papers}", indent=2)
    for row in by_train(asked.requirement, asked.unit, asked.stiffness):
        (low, high), turned = row.band_range, row.design.unit
        _terminal.say(
            f"  {words.train(turned.train)}, n = {turned.turns:+.0f}: {row.design.band_exact:.4g} Hz "
            f"({low:.4g} to {high:.4g} Hz over 90 % of the rotor's inertia), {row.for_band:.0f} N·m/rad for "
            f"{asked.requirement.bandwidth:g} Hz, {row.least:.0f} N·m/rad for all demands",
            indent=4,
        )
    if robust:
        print(f"with 95 % of all parts within tolerance: {robust.stiffness:.0f} N·m/rad")
    print(f"report: {report}")
