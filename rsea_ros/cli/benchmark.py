"""`rsea benchmark`: the cause-naming benchmark, for this project and for others."""

from __future__ import annotations

import argparse
from collections.abc import Mapping

from rsea_ros.cli import _benchmark_make, _benchmark_run, _benchmark_score
from rsea_ros.cli._actions import Action, add_actions

HELP = "name hidden causes: make records of known truth, answer them, score answers (make, run, score)"
EXAMPLE = "rsea benchmark make records --seed 1 && rsea benchmark run records --out answers.jsonl"
ACTIONS: Mapping[str, Action] = {
    "make": Action("write a data set, and its truth apart", _benchmark_make.add_make, _benchmark_make.run),
    "run": Action("answer a data set by this project", _benchmark_run.add_run, _benchmark_run.run),
    "score": Action("score answers against the truth", _benchmark_score.add_score, _benchmark_score.run),
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the actions."""
    add_actions(parser, ACTIONS)


def run(args: argparse.Namespace) -> int:
    """Run the action."""
    return ACTIONS[args.action].run(args)
