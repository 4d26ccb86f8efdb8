"""`rsea diagnose`: the causes of the simulation error, and the improvement from each."""

import argparse
from dataclasses import replace
from pathlib import Path
from typing import get_args

from rich.console import Console

from msg_adapters import TopicMap, read_record
from msg_adapters.records import write_overlay
from rsea_ros.cli import _options, _terminal
from rsea_ros.cli.check import check_records
from rsea_ros.diagnosis.result import Diagnosis, Verdict
from rsea_ros.diagnosis.settings import MOST_CAUSES, DiagnosisSettings
from rsea_ros.effects.catalogue import effect_named
from rsea_ros.errors import ParameterError
from rsea_ros.model.extent import bound_values
from rsea_ros.records.record import Record
from rsea_ros.report.remark_words import command
from rsea_ros.report.result_files import DIAGNOSIS, DIAGNOSIS_JSON, MODEL
from rsea_ros.report.words import command_row

HELP = "find the causes of the simulation error: name, size, gain, extended model"
EXAMPLE = "rsea diagnose run.mcap --rig my_bench.yaml --out results"
FAULTS = "faults"
_FINDINGS = " (faults: of the data; off_rig: a fitted value is far from the rig's)"
_MUCH = 0.2
"""Share of the residual above the noise; if more stays unexplained, the next step is `rsea law`."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    _options.add_runs(parser, "several runs of one bench")
    _options.add_conditions(parser)
    add("--holdout", metavar="BAG", help="a run for testing only (default: a quarter of the runs, in blocks)")
    about = "a run of the machine after one cause was taken out of it: is it predicted without that cause?"
    add("--edited", metavar="BAG", help=about)
    add("--without-cause", metavar="EFFECT", help="the cause that was taken out of the machine of --edited")
    about = "add the smallest size of each effect that these runs would have shown: does the alarm work?"
    add("--smallest", action="store_true", help=about)
    _options.add_results(parser, ", ".join(DIAGNOSIS), "out/diagnose-BAG")
    about = "effects to leave out of the search"
    add("--without", nargs="+", action="extend", default=[], metavar="EFFECT", help=about)
    most = "largest number of causes (default %(default)s)"
    add("--max-causes", type=int, default=MOST_CAUSES, metavar="N", help=most)
    _options.add_json(parser, DIAGNOSIS_JSON)
    _options.add_fail_on(parser, (*get_args(Verdict), FAULTS, _options.OFF_RIG), _FINDINGS)
    _options.add_topic_options(parser, window=True)


def run(args: argparse.Namespace) -> int:
    if bool(args.edited) != bool(args.without_cause) or args.edited == "":
        raise ParameterError("--edited BAG and --without-cause EFFECT: one is given, expected both or none")
    files, default = [*args.bags, *args.conditions], f"diagnose-{Path(args.bags[0]).stem}"
    inputs = [*files, args.rig, args.holdout, args.edited]
    place = _options.results_place(args, Path("out") / default, DIAGNOSIS, inputs)
    rig, topics = _options.rig_of(args, args.holdout, args.edited), _options.topic_map(args)
    with _terminal.progress("diagnose") as tell:
        tell("reading", 0.0)
        runs = [*args.bags, *([args.holdout] if args.holdout else [])]
        _options.each_once([*runs, *([args.edited] if args.edited else [])])
        records = [readable(bag, topics, args) for bag in runs]
        records += [readable(args.edited, topics)] if args.edited else []
        raw, records = records[0], check_records(records, rig, topics.axis, quiet=args.json, masks=True)
        changed = records.pop() if args.edited else None
        holdout = records.pop() if args.holdout else None
        # after the bags, so that a bad one is refused at once
        from rsea_ros.diagnosis.diagnose import diagnose
        from rsea_ros.report.diagnosis.page import write_diagnosis

        without = args.without_cause and effect_named(args.without_cause).name
        settings = DiagnosisSettings(args.max_causes, tuple(effect_named(name).name for name in args.without))
        choice = _options.rig_choice(args)
        result = replace(diagnose(records, rig, holdout, tell, settings), rig_choice=choice)
        if args.smallest:
            from rsea_ros.diagnosis.smallest_change import smallest_changes

            tell("looking for the smallest changes", 0.98)
            result = replace(result, smallest=smallest_changes(result, records))
        refused: ParameterError | None = None
        if changed is not None:
            from rsea_ros.diagnosis.edit import edited

            try:
                result = replace(result, edit=edited(result, changed, without))
            except ParameterError as error:  # the diagnosis stands
                refused = error
        origin = _options.provenance("diagnose", files, args.rig)
        report = write_diagnosis(result, raw, place, write_overlay, origin)
    if args.json:
        _options.print_file(report.parent / DIAGNOSIS_JSON)
    else:
        _print(result, report)
    if refused is not None:
        raise refused
    findings = {result.verdict, *([FAULTS] if result.faults else []), *_options.off_rig(result.remarks)}
    return _options.FOUND if findings.intersection(args.fail_on) else 0


def readable(bag: str, topics: TopicMap, args: argparse.Namespace | None = None) -> Record:
    """Return a run with all its faults, which are findings. args: options that cut it, or None.

    Raises BagError or IdentificationError for a run that cannot be diagnosed.
    """
    from rsea_ros.checks.carried import check_diagnosable

    record = bound_values(read_record([bag], topics=topics, strict=False))
    record = record if args is None else _options.cut(record, args)
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
    from rsea_ros.report.diagnosis.words import terminal_lines

    console, width = Console(), _terminal.width()
    for line in terminal_lines(result, width):
        console.print(line, highlight=False, soft_wrap=True)
    print(f"report      {report}")
    if unexplained_share(result) > _MUCH:
        law = command("law", result.sources, result.rig_name, result.rig_choice, str(report.parent / MODEL))
        print(command_row("law", "of the remaining residual:", law, width))
