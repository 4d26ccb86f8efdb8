"""`rsea identify`: parameters with confidence from recorded runs."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, get_args

from msg_adapters import read_record
from rsea_ros.cli._output import FOUND, add_fail_on, add_json, add_results, print_file, results_place
from rsea_ros.cli._terminal import progress, say, show
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
from rsea_ros.identification.result import Verdict
from rsea_ros.report.result_files import IDENTIFICATION, IDENTIFICATION_JSON, MODEL

if TYPE_CHECKING:
    from rsea_ros.identification.result import Identification

HELP = "identify frequency response and parameters with intervals from recorded runs"
EXAMPLE = "rsea identify run.mcap --rig my_bench.yaml --out results"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    add_runs(parser)
    add_rig(parser)
    add_results(parser, ", ".join(IDENTIFICATION), "out/identify-BAG")
    add_json(parser, IDENTIFICATION_JSON)
    add_fail_on(parser, (*get_args(Verdict), OFF_RIG), " (a fitted value is far from the rig's)")
    add_topic_options(parser)
    add_window_options(parser)


def run(args: argparse.Namespace) -> int:
    """Identify and write the results."""
    from rsea_ros.model.rig_file import load_rig

    default = Path("out") / f"identify-{Path(args.bags[0]).stem}"
    place = results_place(args, default, IDENTIFICATION, [*args.bags, args.rig])
    rig, topics = load_rig(args.rig), topic_map(args)
    with progress("identify") as tell:
        tell("reading", 0.0)
        records = [cut(read_record([bag], topics=topics), args) for bag in each_once(args.bags)]
        from rsea_ros.cli._checks import check_records

        records = check_records(records, rig, topics.axis, quiet=args.json, masks=False)
        from rsea_ros.cli._output import provenance
        from rsea_ros.identification.identify import (
            identify,
        )  # takes 0.7 s, which a refused bag need not wait for
        from rsea_ros.report.identification.page import write_results

        result = replace(identify(records, rig, tell), rig_choice=rig_choice(args))
        report = write_results(result, place, provenance("identify", args.bags, args.rig))
    if args.json:
        print_file(report.parent / IDENTIFICATION_JSON)
    else:
        _print(result, report)
    findings = {result.verdict, *off_rig(result.remarks)}
    return FOUND if findings.intersection(args.fail_on) else 0


def _print(result: Identification, report: Path) -> None:
    """Print the verdict, the table, and a line for each remark."""
    from rsea_ros.report.identification.words import (
        doubt_sentences,
        next_command,
        statics_sentences,
        terminal_table,
        verdict_sentence,
    )
    from rsea_ros.report.remark_words import fault_lines, remark_sentences
    from rsea_ros.report.rig import right_rig, split_off_rig

    say(verdict_sentence(result))
    following = next_command(result)
    if following:
        print(f"next: {following}")
    for line in fault_lines(result.faults):
        say(f"data: {line}", indent=6)
    show(terminal_table(result, None))
    sentences = statics_sentences(result.statics) if result.statics else ()
    off, others = split_off_rig(result.remarks)
    ask = [right_rig(str(report.parent / MODEL))] if off else []
    for sentence in (
        *remark_sentences(off),
        *ask,
        *sentences,
        *doubt_sentences(result),
        *remark_sentences([*others, *result.clocks]),
    ):
        say(sentence, indent=2)
    print(f"report: {report}")
