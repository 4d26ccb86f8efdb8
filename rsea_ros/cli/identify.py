"""`rsea identify`: parameters with confidence from recorded runs."""

import argparse
from dataclasses import replace
from pathlib import Path
from typing import get_args

from rich.console import Console

from msg_adapters import read_record
from rsea_ros.cli import _options, _terminal
from rsea_ros.cli.check import check_records
from rsea_ros.identification.result import Identification, Verdict
from rsea_ros.report.remark_words import fault_lines, remark_sentences, right_rig, split_off_rig
from rsea_ros.report.result_files import IDENTIFICATION, IDENTIFICATION_JSON, MODEL

HELP = "identify frequency response and parameters with intervals from recorded runs"
EXAMPLE = "rsea identify run.mcap --rig my_bench.yaml --out results"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    _options.add_runs(parser)
    _options.add_conditions(parser)
    _options.add_results(parser, ", ".join(IDENTIFICATION), "out/identify-BAG")
    _options.add_json(parser, IDENTIFICATION_JSON)
    findings = (*get_args(Verdict), _options.OFF_RIG)
    _options.add_fail_on(parser, findings, " (a fitted value is far from the rig's)")
    _options.add_topic_options(parser, window=True)


def run(args: argparse.Namespace) -> int:
    default = Path("out") / f"identify-{Path(args.bags[0]).stem}"
    files = [*args.bags, *args.conditions]
    place = _options.results_place(args, default, IDENTIFICATION, [*files, args.rig])
    rig, topics = _options.rig_of(args), _options.topic_map(args)
    with _terminal.progress("identify") as tell:
        tell("reading", 0.0)
        bags = _options.each_once(args.bags)
        records = [_options.cut(read_record([bag], topics=topics), args) for bag in bags]
        records = check_records(records, rig, topics.axis, quiet=args.json, masks=False)
        from rsea_ros.identification.identify import identify  # 0.7 s: a refused bag need not wait for it
        from rsea_ros.report.identification import write_results

        result = replace(identify(records, rig, tell), rig_choice=_options.rig_choice(args))
        report = write_results(result, place, _options.provenance("identify", files, args.rig))
    if args.json:
        _options.print_file(report.parent / IDENTIFICATION_JSON)
    else:
        _print(result, report)
    findings = {result.verdict, *_options.off_rig(result.remarks)}
    return _options.FOUND if findings.intersection(args.fail_on) else 0


def _print(result: Identification, report: Path) -> None:
    from rsea_ros.report import identification as words

    _terminal.say(words.verdict_sentence(result))
    if following := words.next_command(result):
        print(f"next: {following}")
    for line in fault_lines(result.faults):
        _terminal.say(f"data: {line}", indent=6)
    Console(width=_terminal.width()).print(words.terminal_table(result, None))
    off, others = split_off_rig(result.remarks)
    sentences = [*remark_sentences(off), *([right_rig(str(report.parent / MODEL))] if off else [])]
    sentences += words.statics_sentences(result.statics) if result.statics else ()
    sentences += [*words.doubt_sentences(result), *remark_sentences([*others, *result.clocks])]
    for sentence in sentences:
        _terminal.say(sentence, indent=2)
    print(f"report: {report}")
