"""`rsea check`: a traffic light for each property that a fit needs of a record."""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from msg_adapters import TopicMap, read_record
from msg_adapters.topic_map import AXES
from rsea_ros.cli import _terminal as _lines
from rsea_ros.cli._output import FOUND
from rsea_ros.cli._terminal import say
from rsea_ros.cli._topics import (
    add_rig,
    add_runs,
    add_topic_options,
    add_window_options,
    cut,
    rig_choice,
    topic_map,
)
from rsea_ros.errors import RseaError
from rsea_ros.records.record import Channel

if TYPE_CHECKING:
    from rsea_ros.checks.finding import Findings

HELP = "check topics, rates, clocks, noise, sign, scale and rig of a record in seconds"
EXAMPLE = "rsea check run.mcap --rig my_bench.yaml"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    add_runs(parser)
    add_rig(parser)
    add = parser.add_argument
    add("--json", action="store_true", help="print the findings as JSON (docs/check.md) and nothing else")
    add(
        "--fail-on",
        choices=("red", "amber"),
        help=f"exit status {FOUND} if a light is this one or worse",
    )
    add_topic_options(parser)
    add_window_options(parser)


def run(args: argparse.Namespace) -> int:
    """Check and print."""
    from rsea_ros.model.rig_file import load_rig

    rig, topics = load_rig(args.rig), topic_map(args)
    records = [cut(read_record([bag], topics=topics, strict=False), args) for bag in args.bags]
    from rsea_ros.checks.check import check_record  # after the bags, so that a bad bag is refused at once
    from rsea_ros.checks.finding import LIGHTS, worst

    checks = [
        replace(
            check_record(record, rig, topics.axis, partial(other_axes, bag, topics, args), values=True),
            rig_choice=rig_choice(args),
        )
        for bag, record in zip(args.bags, records, strict=True)
    ]
    if args.json:
        from rsea_ros.report.check import check_json

        print(json.dumps(check_json(checks), indent=1, allow_nan=False, ensure_ascii=False))
    else:
        _print(checks)
    light = worst([c.light for c in checks])
    fails = args.fail_on is not None and LIGHTS.index(light) >= LIGHTS.index(args.fail_on)
    return FOUND if fails else 0


def other_axes(bag: str, topics: TopicMap, args: argparse.Namespace) -> Mapping[str, Channel]:
    """Return every axis of the wrench of a bag by name, for a check with a dead axis."""
    axes = {}
    for axis in AXES:
        try:
            record = read_record([bag], topics=replace(topics, axis=axis), strict=False)
        except RseaError:
            continue
        if "ft" in record:
            axes[axis] = cut(record, args)["ft"]
    return axes


def _print(checks: list[Findings]) -> None:
    from rich.console import Console

    from rsea_ros.report.check import check_lines, summary

    console = Console()
    for findings in checks:
        print(findings.source)
        for line in check_lines(findings, _lines.columns()):
            console.print(line, highlight=False, soft_wrap=True)
    say(summary(checks))
