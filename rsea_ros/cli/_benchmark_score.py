"""`rsea benchmark score`: answers against the truth, beside answers that need no skill."""

from __future__ import annotations

import argparse
import json
import math
from dataclasses import asdict
from typing import TYPE_CHECKING

from rsea_ros.cli._columns import columns
from rsea_ros.cli._output import path
from rsea_ros.errors import ParameterError

if TYPE_CHECKING:
    from rsea_ros.benchmark.scoring import ScoreInterval, Scores

HEAD = (
    "entry", "named right, %", "false names, %", "silent if none, %", "Brier", "median rank", "answered, %",
)  # fmt: skip


def add_score(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of `score`."""
    parser.add_argument("dataset", type=path, help="folder of the data set")
    parser.add_argument("answers", type=path, nargs="+", help="JSON lines of an entry, a file each")
    parser.add_argument("--truth", type=path, help="truth of the data set (default DATASET.truth.json)")
    parser.add_argument("--json", action="store_true", help="print the scores as JSON and nothing else")


def run(args: argparse.Namespace) -> int:
    """Print the scores, each with its 95 % interval over records."""
    from rsea_ros.benchmark.dataset import read_answers, read_dataset
    from rsea_ros.benchmark.scoring import BASELINES, read_truth, score

    dataset = read_dataset(args.dataset)
    truths = read_truth(args.truth or dataset.truth, dataset)
    entries = {name: make(dataset) for name, make in BASELINES.items()}
    for file in args.answers:
        name = file.name.removesuffix(".jsonl")
        if name in entries:
            raise ParameterError(f"{file}: a second row {name!r}, expected another file name")
        entries[name] = read_answers(file, dataset)
    scores = {name: score(answers, truths, dataset.effects) for name, answers in entries.items()}
    if args.json:
        print(json.dumps({"records": len(truths), "entries": {n: _document(s) for n, s in scores.items()}}))
    else:
        print(columns([HEAD, *((name, *_cells(s)) for name, s in scores.items())]))
        print(f"{len(truths)} records; in brackets: 95 % intervals over records")
    return 0


def _cells(scores: Scores) -> tuple[str, ...]:
    percent = (scores.named_right, scores.false_names, scores.silent)
    plain = (_cell(scores.brier, 1.0, 2), _cell(scores.rank, 1.0, 1))
    return (*(_cell(s, 100.0, 0) for s in percent), *plain, f"{100.0 * scores.answered:.0f}")


def _cell(interval: ScoreInterval, factor: float, digits: int) -> str:
    if math.isnan(interval.value):
        return "–"
    value, low, high = (f"{factor * v:.{digits}f}" for v in interval)
    return f"{value} [{low}, {high}]"


def _document(scores: Scores) -> dict[str, object]:
    values = {name: value for name, value in asdict(scores).items() if name != "answered"}
    finite = {n: None if math.isnan(v[0]) else list(v) for n, v in values.items()}
    return {**finite, "answered": scores.answered}
