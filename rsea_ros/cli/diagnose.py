"""`rsea diagnose`: what the simulation gets wrong, why, and how much knowing it gains."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import get_args

from msg_adapters import TopicMap, read_record
from msg_adapters.overlay import write_overlay
from rsea_ros.cli._output import FOUND, add_fail_on, add_force, results_place
from rsea_ros.cli._progress import progress
from rsea_ros.cli._topics import add_topic_options, add_window_options, cut, each_once, topic_map
from rsea_ros.diagnosis.result import Diagnosis, Verdict
from rsea_ros.diagnosis.settings import MOST_CAUSES, DiagnosisSettings
from rsea_ros.signals import Record

HELP = "what the simulation gets wrong, the cause, the extended model and the gain"
EXAMPLE = "rsea diagnose run.mcap --rig my_bench.yaml --out results"
RIG = "paper_high_impedance"
FILES = ("diagnosis.json", "model.yaml", "report.html", "overlay.mcap")
FAULTS = "faults"
_MUCH = 0.2
"""Of what is wrong: with more than that unexplained, the next step is a law for what has no name."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    add = parser.add_argument
    add("bags", nargs="+", metavar="BAG", help="rosbag2 directory, .mcap or .db3; several runs of one bench")
    add("--rig", default=RIG, help="rig file, or the name of one in config/rigs (default %(default)s)")
    add("--holdout", metavar="BAG", help="a run that only judges (default: every fourth second of the runs)")
    add("--out", help=f"directory for {', '.join(FILES)} (default out/diagnose-BAG, -2, …)")
    add_force(parser)
    add("--without", nargs="+", action="extend", default=[], metavar="EFFECT", help="effects not to try")
    most = "causes at most (default %(default)s)"
    add("--max-causes", type=int, default=MOST_CAUSES, metavar="N", help=most)
    add("--json", action="store_true", help="print diagnosis.json to stdout and nothing else")
    add_fail_on(parser, (*get_args(Verdict), FAULTS), " (of the data)")
    add_topic_options(parser)
    add_window_options(parser)


def run(args: argparse.Namespace) -> int:
    """Diagnose and write the results."""
    from rsea_ros.model.rig_file import load_rig

    inputs = [*args.bags, args.rig, args.holdout]
    place = results_place(args, Path("out") / f"diagnose-{Path(args.bags[0]).stem}", FILES, inputs)
    rig, topics = load_rig(args.rig), topic_map(args)
    with progress("diagnose") as tell:
        tell("reading", 0.0)
        runs = [*each_once(args.bags), *([args.holdout] if args.holdout else [])]
        records = [readable(bag, topics, args) for bag in runs]
        from rsea_ros.cli._checks import checked

        raw, records = records[0], checked(records, rig, topics.axis, quiet=args.json, masks=True)
        holdout = records.pop() if args.holdout else None
        from rsea_ros.cli._provenance import provenance
        from rsea_ros.diagnosis.diagnose import diagnose  # after the bags: a bad one is told of at once
        from rsea_ros.effects.catalogue import effect_named
        from rsea_ros.report.diagnosis.files import write_diagnosis

        without = tuple(effect_named(name).name for name in args.without)
        result = diagnose(records, rig, holdout, tell, DiagnosisSettings(args.max_causes, without))
        report = write_diagnosis(
            result, raw, place, write_overlay, provenance("diagnose", args.bags, args.rig)
        )
    if args.json:
        print((report.parent / "diagnosis.json").read_text(encoding="utf-8"), end="")
    else:
        _print(result, report)
        if left_unexplained(result) > _MUCH:
            model = report.parent / "model.yaml"
            print(f"law         of what is left: rsea law {' '.join(args.bags)} --rig {model}")
    findings = {result.verdict, *([FAULTS] if result.faults else [])}
    return FOUND if findings.intersection(args.fail_on) else 0


def readable(bag: str, topics: TopicMap, args: argparse.Namespace | None = None) -> Record:
    """Return a run with all its faults, which are findings. args: what to cut of it, if anything.

    Raises BagError or IdentificationError for one that cannot be diagnosed at all.
    """
    from rsea_ros.checks.usable import check_diagnosable
    from rsea_ros.model.extent import bounded

    record = bounded(read_record([bag], topics=topics, strict=False))
    record = record if args is None else cut(record, args)
    check_diagnosable(record)
    return record


def left_unexplained(result: Diagnosis) -> float:
    """Return which share of what the baseline leaves above the noise, as power, the causes leave still."""
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

    console = Console()
    for line in terminal_lines(result):
        console.print(line, highlight=False, soft_wrap=True)
    console.print(f"report      {report}", highlight=False, soft_wrap=True, markup=False)
