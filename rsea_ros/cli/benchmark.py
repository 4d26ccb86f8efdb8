"""`rsea benchmark`: the cause-naming benchmark, for this project and for others."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from typing import NamedTuple

from rsea_ros.cli import _benchmark_make, _benchmark_run, _benchmark_score

HELP = "name hidden causes: make records of known truth, answer them, score answers (make, run, score)"
EXAMPLE = "rsea benchmark make records --seed 1 && rsea benchmark run records --out answers.jsonl"


class Action(NamedTuple):
    """The interface of an action of `benchmark`."""

    help: str
    add: Callable[[argparse.ArgumentParser], None]
    run: Callable[[argparse.Namespace], int]


ACTIONS: Mapping[str, Action] = {
    "make": Action("write a data set, and its truth apart", _benchmark_make.add_make, _benchmark_make.run),
    "run": Action("answer a data set by this project", _benchmark_run.add_run, _benchmark_run.run),
    "score": Action("score answers against the truth", _benchmark_score.add_score, _benchmark_score.run),
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the actions."""
    actions = parser.add_subparsers(dest="action", required=True, metavar="|".join(ACTIONS))
    for name, action in ACTIONS.items():
        action.add(actions.add_parser(name, help=action.help, description=action.help))


def run(args: argparse.Namespace) -> int:
    """Run the action."""
    return ACTIONS[args.action].run(args)
