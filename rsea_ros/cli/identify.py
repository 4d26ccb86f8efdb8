"""`rsea identify`: parameters with confidence from recorded runs."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, get_args

from msg_adapters import read_record
from rsea_ros.cli._output import FOUND, add_fail_on, add_force, results_place
from rsea_ros.cli._progress import progress
from rsea_ros.cli._topics import add_topic_options, add_window_options, cut, each_once, topic_map
from rsea_ros.identification.result import Verdict

if TYPE_CHECKING:
    from rsea_ros.identification.result import Identification

HELP = "frequency response and parameters with confidence from recorded runs"
EXAMPLE = "rsea identify run.mcap --rig my_bench.yaml --out results"
FILES = ("identification.json", "model.yaml", "report.html")
NARROWEST = 100
"""Columns of the table where no terminal says how many it has."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    parser.add_argument("bags", nargs="+", metavar="BAG", help="rosbag2 directory, .mcap or .db3")
    parser.add_argument(
        "--rig",
        default="paper_high_impedance",
        help="rig file, or the name of one in config/rigs (default %(default)s)",
    )
    parser.add_argument(
        "--out",
        help="directory for identification.json, model.yaml, report.html (default out/identify-BAG, -2, …)",
    )
    add_force(parser)
    parser.add_argument(
        "--json", action="store_true", help="print identification.json to stdout and nothing else"
    )
    add_fail_on(parser, get_args(Verdict))
    add_topic_options(parser)
    add_window_options(parser)


def run(args: argparse.Namespace) -> int:
    """Identify and write the results."""
    from rsea_ros.model.rig_file import load_rig

    default = Path("out") / f"identify-{Path(args.bags[0]).stem}"
    place = results_place(args, default, FILES, [*args.bags, args.rig])
    rig, topics = load_rig(args.rig), topic_map(args)
    with progress("identify") as tell:
        tell("reading", 0.0)
        records = [cut(read_record([bag], topics=topics), args) for bag in each_once(args.bags)]
        from rsea_ros.cli._checks import checked

        records = checked(records, rig, topics.axis, quiet=args.json, masks=False)
        from rsea_ros.cli._provenance import provenance
        from rsea_ros.identification.identify import identify  # 0.7 s that a bag refused need not wait for
        from rsea_ros.report.identification.files import write_results

        result = replace(identify(records, rig, tell), rig_option=args.rig)
        report = write_results(result, place, provenance("identify", args.bags, args.rig))
    if args.json:
        print((report.parent / "identification.json").read_text(encoding="utf-8"))
    else:
        _print(result, report)
    return FOUND if result.verdict in args.fail_on else 0


def _print(result: Identification, report: Path) -> None:
    """Print the verdict, the table, and a line for each thing to know beside it."""
    from rich.console import Console

    from rsea_ros.report.fault_words import fault_lines
    from rsea_ros.report.identification.statics import statics_sentences
    from rsea_ros.report.identification.terminal import terminal_table
    from rsea_ros.report.identification.words import doubt_sentences, next_command, verdict_sentence

    console = Console()
    if not console.is_terminal:
        console = Console(width=NARROWEST)
    following = next_command(result)
    print(f"{verdict_sentence(result)}{f'; next: {following}' if following else ''}")
    for line in fault_lines(result.faults):
        print(f"data: {line}")
    console.print(terminal_table(result, None))
    found = statics_sentences(result.statics) if result.statics else ()
    for sentence in (*found, *doubt_sentences(result), *result.statements, *result.clocks):
        print(sentence)
    print(f"report: {report}")
