"""`rsea diagnose`: the causes of the simulation error, and the improvement from each."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import get_args

from msg_adapters import TopicMap, read_record
from msg_adapters.records import write_overlay
from rsea_ros.cli import _terminal as _lines
from rsea_ros.cli._output import FOUND, add_fail_on, add_json, add_results, print_file, results_place
from rsea_ros.cli._terminal import progress
from rsea_ros.cli._topics import (
    OFF_RIG,
    add_rig,
    add_runs,
    add_topic_options,
    add_window_options,
    cut,
    each_once,
    off_rig,
    rig_choice,
    topic_map,
)
from rsea_ros.diagnosis.result import Diagnosis, Verdict
from rsea_ros.diagnosis.settings import MOST_CAUSES, DiagnosisSettings
from rsea_ros.records.record import Record
from rsea_ros.report.result_files import DIAGNOSIS, DIAGNOSIS_JSON, MODEL

HELP = "find the causes of the simulation error: name, size, gain, extended model"
EXAMPLE = "rsea diagnose run.mcap --rig my_bench.yaml --out results"
FAULTS = "faults"
_FINDINGS = " (faults: of the data; off_rig: a fitted value is far from the rig's)"
_MUCH = 0.2
"""Share of the residual above the noise; if more stays unexplained, the next step is `rsea law`."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    add = parser.add_argument
    add_runs(parser, "several runs of one bench")
    add_rig(parser)
    add("--holdout", metavar="BAG", help="a run for testing only (default: a quarter of the runs, in blocks)")
    add_results(parser, ", ".join(DIAGNOSIS), "out/diagnose-BAG")
    add(
        "--without",
        nargs="+",
        action="extend",
        default=[],
        metavar="EFFECT",
        help="effects to leave out of the search",
    )
    most = "largest number of causes (default %(default)s)"
    add("--max-causes", type=int, default=MOST_CAUSES, metavar="N", help=most)
    add_json(parser, DIAGNOSIS_JSON)
    add_fail_on(parser, (*get_args(Verdict), FAULTS, OFF_RIG), _FINDINGS)
    add_topic_options(parser)
    add_window_options(parser)


def run(args: argparse.Namespace) -> int:
    """Diagnose and write the results."""
    from rsea_ros.model.rig_file import load_rig

    inputs = [*args.bags, args.rig, args.holdout]
    place = results_place(args, Path("out") / f"diagnose-{Path(args.bags[0]).stem}", DIAGNOSIS, inputs)
    rig, topics = load_rig(args.rig), topic_map(args)
    with progress("diagnose") as tell:
        tell("reading", 0.0)
        runs = each_once([*args.bags, *([args.holdout] if args.holdout else [])])
        records = [readable(bag, topics, args) for bag in runs]
        from rsea_ros.cli._checks import check_records

        raw, records = records[0], check_records(records, rig, topics.axis, quiet=args.json, masks=True)
        holdout = records.pop() if args.holdout else None
        from rsea_ros.cli._output import provenance
        from rsea_ros.diagnosis.diagnose import (
            diagnose,
        )  # after the bags, so that a bad bag is refused at once
        from rsea_ros.effects.catalogue import effect_named
        from rsea_ros.report.diagnosis.files import write_diagnosis

        without = tuple(effect_named(name).name for name in args.without)
        settings = DiagnosisSettings(args.max_causes, without)
        result = replace(diagnose(records, rig, holdout, tell, settings), rig_choice=rig_choice(args))
        report = write_diagnosis(
            result, raw, place, write_overlay, provenance("diagnose", args.bags, args.rig)
        )
    if args.json:
        print_file(report.parent / DIAGNOSIS_JSON)
    else:
        _print(result, report)
    findings = {result.verdict, *([FAULTS] if result.faults else []), *off_rig(result.remarks)}
    return FOUND if findings.intersection(args.fail_on) else 0


def readable(bag: str, topics: TopicMap, args: argparse.Namespace | None = None) -> Record:
    """Return a run with all its faults, which are findings. args: options that cut it, or None.

    Raises BagError or IdentificationError for a run that cannot be diagnosed.
    """
    from rsea_ros.checks.carried import check_diagnosable
    from rsea_ros.model.extent import bound_values

    record = bound_values(read_record([bag], topics=topics, strict=False))
    record = record if args is None else cut(record, args)
    check_diagnosable(record)
    return record


def unexplained_share(result: Diagnosis) -> float:
    """Return the power above the noise with the causes, relative to that of the baseline."""
    n = result.channel
    noise, before, after = (
        rms.get(n, 0.0) ** 2 for rms in (result.noise_rms, result.residual_rms, result.extended_residual_rms)
    )
    if result.verdict == "nothing_wrong" or before <= noise:
        return 0.0
    return max(0.0, (after if result.causes else before) - noise) / (before - noise)


def _print(result: Diagnosis, report: Path) -> None:
    from rich.console import Console

    from rsea_ros.report.diagnosis.terminal import terminal_lines
    from rsea_ros.report.rig import command
    from rsea_ros.report.wrapped_lines import command_row

    console, width = Console(), _lines.columns()
    for line in terminal_lines(result, width):
        console.print(line, highlight=False, soft_wrap=True)
    print(f"report      {report}")
    if unexplained_share(result) > _MUCH:
        law = command("law", result.sources, result.rig_name, result.rig_choice, str(report.parent / MODEL))
        print(command_row("law", "of the remaining residual:", law, width))
