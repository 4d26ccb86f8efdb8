"""`rsea paper`: every table and figure of the paper recomputed beside the printed value."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import TYPE_CHECKING

from rsea_ros.cli._options import add_json, add_results, path, print_file, results_place
from rsea_ros.cli._terminal import progress, whole_number
from rsea_ros.errors import ParameterError
from rsea_ros.model.rig_file import load_rig
from rsea_ros.outputs.files import Destination, NewFiles, check_free
from rsea_ros.records.record import Channel, Record
from rsea_ros.report.result_files import PAPER_JSON, REPORT, json_text

if TYPE_CHECKING:
    from rsea_ros.paper.page import PaperTests

HELP = "recompute every equation, table and figure of the paper beside the printed value"
EXAMPLE = "rsea paper --out paper"
MOVING = {
    "paper_moving_output": ("ft",),
    "two_moving_outputs": ("ft", "position"),
    "separate_stiffnesses": ("ft", "position"),
}
"""Rigs of the moving-output tests, the paper's first, and the channels of the fit."""
CLAMPED = "paper_high_impedance"
BAGS = (CLAMPED, *(f"{rig}_{end}_end" for rig in MOVING for end in ("spring", "housing")))
FILES = (PAPER_JSON, REPORT, *(f"{name}.mcap" for name in BAGS))
SHORTEST = 20.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_results(parser, f"{PAPER_JSON}, {REPORT} and the simulated bags", "out/paper")
    add = parser.add_argument
    about = "duration of each simulated test, s (default %(default)s)"
    add("--duration", type=float, default=160.0, help=about)
    about = "seed of benches, commands and noise (default %(default)s)"
    add("--seed", type=whole_number, default=5, help=about)
    about = "only write the figures of docs/derivation.md into this directory"
    add("--figures", type=path, metavar="DIR", help=about)
    add_json(parser, PAPER_JSON)


def run(args: argparse.Namespace) -> int:
    if args.figures:
        return _figures(args)
    if not args.duration >= SHORTEST:
        raise ParameterError(f"--duration {args.duration:g} s, expected at least {SHORTEST:g} s")
    from rsea_ros.paper.page import paper_json, paper_report

    with progress("paper") as tell, NewFiles(results_place(args, "out/paper", FILES)) as new:
        tests = _tests(args, new, tell)
        tell("page", 0.95)
        results = paper_json(tests)
        path = new.write(PAPER_JSON, json_text(results))
        report = new.write(REPORT, paper_report(tests))
    if args.json:
        print_file(path)
        return 0
    recomputed = [c for c in results["claims"] if c["status"] == "found"]
    agree = sum(c["agrees"] for c in recomputed)
    made = f"{len(recomputed)} printed numbers that follow from others in the paper"
    print(f"{agree} of the {made} agree to the last digit")
    for name, models in results["moving_output"].items():
        for model, sensors in models.items():
            shares = ", ".join(f"{_share(j['explained'])} at the {j['sensor']}" for j in sensors)
            print(f"{name}, {model}: held-out torque explained: {shares}")
    print(f"report: {report}")
    return 0


def _share(explained: float) -> str:
    return f"{100.0 * explained:.2f} %" if explained > 0.0 else "none (worse than no model)"


def _figures(args: argparse.Namespace) -> int:
    from rsea_ros.paper.figures import documentation_figures

    figures = documentation_figures()
    check_free((args.figures / name for name in figures), force=args.force)
    with NewFiles(Destination(args.figures, args.force)) as new:
        written = [new.write(name, svg) for name, svg in figures.items()]
    for file in written:
        print(file)
    return 0


def _tests(args: argparse.Namespace, new: NewFiles, tell: Callable[[str, float], None]) -> PaperTests:
    import numpy as np

    from msg_adapters import read_record, write_record
    from rsea_ros.identification.excitation import ExcitationSettings, excitation
    from rsea_ros.identification.frequency_response import estimate_response
    from rsea_ros.model.simulation import synthesize
    from rsea_ros.paper.page import PaperTests
    from rsea_ros.paper.rival_models import RATE, moving_output

    def bag(name: str, record: Record) -> Record:
        path = new.stage(f"{name}.mcap")
        write_record(record, path)
        return read_record([path])

    tell("high impedance", 0.0)
    values = excitation("chirp", ExcitationSettings(rate=RATE, duration=args.duration, seed=args.seed))
    command = Channel(np.arange(len(values)) / RATE, values)
    rig = load_rig(CLAMPED)
    clamped = estimate_response(bag(rig.name, synthesize(rig, command, seed=args.seed)), "ft")
    moving = {}
    for i, (name, channels) in enumerate(MOVING.items()):
        tell(name.replace("_", " "), 0.1 + 0.28 * i)
        moving[name] = moving_output(
            load_rig(name), bag, duration=args.duration, seed=args.seed, channels=channels
        )
    return PaperTests(clamped, moving)
