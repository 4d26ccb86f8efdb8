"""`rsea check`: a traffic light for each property that a fit needs of a record."""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from rich.console import Console

from msg_adapters import TopicMap, read_record
from msg_adapters.topic_map import AXES
from rsea_ros.cli import _options, _terminal
from rsea_ros.errors import RseaError
from rsea_ros.model.rig_file import load_rig
from rsea_ros.records.record import Channel, Record
from rsea_ros.report.result_files import CHECK

if TYPE_CHECKING:
    from rsea_ros.checks.finding import Findings
    from rsea_ros.model.rig import Rig

HELP = "check topics, rates, clocks, noise, sign, scale and rig of a record in seconds"
EXAMPLE = "rsea check run.mcap --rig my_bench.yaml"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    _options.add_runs(parser)
    add = parser.add_argument
    add("--json", action="store_true", help="print the findings as JSON (docs/check.md) and nothing else")
    about = "directory for report.html and check.json (default: none is written)"
    add("--out", type=_options.path, help=about)
    _options.add_force(parser)
    about = f"exit status {_options.FOUND} if a light is this one or worse"
    add("--fail-on", choices=("red", "amber"), help=about)
    _options.add_topic_options(parser, window=True)


def run(args: argparse.Namespace) -> int:
    from rsea_ros.checks.check import check_record
    from rsea_ros.checks.finding import LIGHTS, worst
    from rsea_ros.report import check as page

    rig, topics = load_rig(args.rig), _options.topic_map(args)
    place = _options.results_place(args, args.out, CHECK, [*args.bags, args.rig]) if args.out else None
    records = [_options.cut(read_record([bag], topics=topics, strict=False), args) for bag in args.bags]

    checks = []
    for bag, record in zip(args.bags, records, strict=True):
        others = partial(other_axes, bag, topics, args)
        found = check_record(record, rig, topics.axis, others, values=True)
        checks.append(replace(found, rig_choice=_options.rig_choice(args)))
    if place:
        report = page.write_check(checks, records, place, _options.provenance("check", args.bags, args.rig))
    if args.json:
        print(json.dumps(page.check_json(checks), indent=1, allow_nan=False, ensure_ascii=False))
    else:
        _print(checks)
        if place:
            print(report)
    light = worst([c.light for c in checks])
    fails = args.fail_on is not None and LIGHTS.index(light) >= LIGHTS.index(args.fail_on)
    return _options.FOUND if fails else 0


def other_axes(bag: str, topics: TopicMap, args: argparse.Namespace) -> Mapping[str, Channel]:
    """Return every axis of the wrench of a bag by name, for a check with a dead axis."""
    axes = {}
    for axis in AXES:
        try:
            record = read_record([bag], topics=replace(topics, axis=axis), strict=False)
        except RseaError:
            continue
        if "ft" in record:
            axes[axis] = _options.cut(record, args)["ft"]
    return axes


def _print(checks: list[Findings]) -> None:
    from rsea_ros.report.check import check_lines, summary

    console = Console()
    for findings in checks:
        print(findings.source)
        for line in check_lines(findings, _terminal.width()):
            console.print(line, highlight=False, soft_wrap=True)
    _terminal.say(summary(checks))


def check_records(
    records: Sequence[Record], rig: Rig, axis: str, *, quiet: bool, masks: bool
) -> list[Record]:
    """Return records that are to be fitted, each with the faults that were found, without dead channels.

    Prints a line for each warning unless quiet. masks: see with_faults.
    Raises IdentificationError if nothing moves, or a position is lacking that the rig is judged by.
    """
    from rsea_ros.checks.carried import note_unused, require_motion, with_faults
    from rsea_ros.checks.check import check_record
    from rsea_ros.checks.finding import unused_sentence
    from rsea_ros.model.extent import check_pace
    from rsea_ros.model.inverse import is_inverse, require_position
    from rsea_ros.report.check import warnings

    for record in records:
        check_pace(record)
        require_motion(record)
        if is_inverse(rig):
            require_position(record)
    checks = [check_record(record, rig, axis) for record in records]
    lines = dict.fromkeys(line for findings in checks for line in warnings(findings))
    if lines and not quiet:
        print(f"compared with rig {rig.name}:")
    for line in () if quiet else lines:
        _terminal.say(line, indent=2)
    kept = [with_faults(note_unused(r, rig), f, masks=masks) for r, f in zip(records, checks, strict=True)]
    for sentence in () if quiet else dict.fromkeys(filter(None, (unused_sentence(r, rig) for r in records))):
        _terminal.say(sentence)
    return kept
