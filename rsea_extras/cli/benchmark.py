"""`rsea benchmark`: the cause-naming benchmark, for this project and for others.

`make` writes records of known truth by a plant that shares no code with the model, `run` answers them by this
project, `score` holds answers against the truth, beside answers that need no skill.
"""

from __future__ import annotations

import argparse
import json
import math
import runpy
import time
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Any

from rsea_extras.benchmark.dataset import Answer, Dataset, read_answers, read_dataset, read_text
from rsea_ros import RseaError, load_rig
from rsea_ros.extension.base import BenchmarkError, ParameterError, Progress, check_free, write_file
from rsea_ros.extension.verb import (
    Action,
    add_force,
    columns,
    path,
    positive,
    progress,
    say,
    verb_of,
    whole_number,
)

if TYPE_CHECKING:
    from rsea_extras.benchmark import scoring

HELP = "name hidden causes: make records of known truth, answer them, score answers (make, run, score)"
EXAMPLE = "rsea benchmark make records --seed 1 && rsea benchmark run records --out answers.jsonl"
GENERATOR = Path(__file__).resolve().parents[2] / "bench" / "diagnosis" / "cause_naming.py"
SHORTEST, MOST = 16, 9999
"""Characters of a secret seed: shorter ones could be found by trying; records of a data set."""
HEAD = (
    "entry", "named right, %", "false names, %", "silent if none, %", "Brier", "median rank", "answered, %",
)  # fmt: skip


def _add_make(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("out", type=path, help="new folder for the data set; the truth goes beside it, OUT.truth.json")
    add("--records", type=whole_number, default=60, help=f"how many, 1 to {MOST} (default %(default)s)")
    add("--duration", type=positive, default=12.0, help="of each record, s, 5 to 600 (default %(default)g)")
    seeds = parser.add_mutually_exclusive_group()
    seeds.add_argument("--seed", type=whole_number, default=1, help="public seed (default %(default)s)")
    secret = f"file with a secret seed: any text of at least {SHORTEST} characters, for a hidden half"
    seeds.add_argument("--seed-file", type=path, help=secret)


def _make(args: argparse.Namespace) -> int:
    if not GENERATOR.is_file():
        raise BenchmarkError("make needs a clone of the repository: its plant is no part of the package")
    if not 1 <= args.records <= MOST:
        raise ParameterError(f"--records {args.records}, expected 1 to {MOST}")
    if not 5.0 <= args.duration <= 600.0:
        raise ParameterError(f"--duration {args.duration:g} s, expected 5 to 600 s")
    file, seed = args.seed_file, str(args.seed)
    if file and len(seed := read_text(file).strip()) < SHORTEST:
        raise ParameterError(f"{file}: {len(seed)} characters, expected at least {SHORTEST} of a secret seed")
    with progress("benchmark") as tell:
        write = runpy.run_path(str(GENERATOR))["write"]
        truth = write(args.out, args.records, args.duration, seed, tell)
    print(f"records     {args.out}\ntruth       {truth}: keep it apart")
    return 0


def _add_run(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("dataset", type=path, help="folder of the data set")
    entry = "diagnose, or the effect that leaves least when fitted alone (default %(default)s)"
    parser.add_argument("--entry", choices=("diagnose", "largest_gain"), default="diagnose", help=entry)
    parser.add_argument("--out", type=path, help="answers, JSON lines (default ENTRY.jsonl)")
    add_force(parser)


def _run(args: argparse.Namespace) -> int:
    out = args.out or Path(f"{args.entry}.jsonl")
    check_free([out], force=args.force)
    records = read_dataset(args.dataset)
    partial = out.with_name(f"{out.name}.partial")
    with progress("benchmark") as tell:
        lines = list(_lines(records, args.entry, partial, tell))
    write_file(out, "".join(f"{json.dumps(line)}\n" for line in lines), force=args.force)
    partial.unlink()
    print(f"answers     {out}: {len(lines)} records")
    refused = [line["error"] for line in lines if "error" in line]
    if refused:
        say(f"refused     {len(refused)} records, no effect named; the first: {refused[0]}", indent=12)
    print(f"next        rsea benchmark score {quote(str(args.dataset))} {quote(str(out))}")
    return 0


def _lines(records: Dataset, entry: str, partial: Path, tell: Progress) -> Iterator[dict[str, Any]]:
    """Yield the answer to each record for JSON.

    partial: keeps the answers as they come; a run that was stopped goes on from there.
    """
    known = _kept_answers(records, entry, partial)
    for number, name in enumerate(records.hashes):
        tell(name, number / len(records.hashes))
        if name not in known:
            known[name] = _answer(records, entry, name)
            marked = ({**line, "entry": entry, "truth": records.hashes[n]} for n, line in known.items())
            write_file(partial, "".join(f"{json.dumps(line)}\n" for line in marked), force=True)
        yield known[name]


def _kept_answers(records: Dataset, entry: str, partial: Path) -> dict[str, dict[str, Any]]:
    """Return the answers of a stopped run of this entry to these very records, by record."""
    kept = {}
    for text in partial.read_text(encoding="utf-8").splitlines() if partial.exists() else ():
        try:
            line = json.loads(text)
        except ValueError:  # empty, or cut off by hand
            continue
        if line.pop("entry") == entry and records.hashes.get(line["record"]) == line.pop("truth"):
            kept[line["record"]] = line
    return kept


def _answer(records: Dataset, entry: str, name: str) -> dict[str, Any]:
    """Return the answer to a record; one that cannot be diagnosed names no effect."""
    from rsea_extras.benchmark.scoring import ENTRIES

    record, rig = records.record(name), load_rig(records.rig_path(name))
    start, failure = time.monotonic(), {}
    try:
        answer = ENTRIES[entry](record, rig)
    except RseaError as error:
        answer, failure = Answer(), {"error": str(error)}
    seconds = round(time.monotonic() - start, 2)
    return {**Answer(answer.causes, seconds).line(name), **failure}


def _add_score(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("dataset", type=path, help="folder of the data set")
    parser.add_argument("answers", type=path, nargs="+", help="JSON lines of an entry, a file each")
    parser.add_argument("--truth", type=path, help="truth of the data set (default DATASET.truth.json)")
    parser.add_argument("--json", action="store_true", help="print the scores as JSON and nothing else")


def _score(args: argparse.Namespace) -> int:
    from rsea_extras.benchmark import scoring

    records = read_dataset(args.dataset)
    truths = scoring.read_truth(args.truth or records.truth, records)
    entries = {name: make(records) for name, make in scoring.BASELINES.items()}
    for file in args.answers:
        name = file.name.removesuffix(".jsonl")
        if name in entries:
            raise ParameterError(f"{file}: a second row {name!r}, expected another file name")
        entries[name] = read_answers(file, records)
    scores = {name: scoring.score(answers, truths, records.effects) for name, answers in entries.items()}
    if args.json:
        print(json.dumps({"records": len(truths), "entries": {n: _document(s) for n, s in scores.items()}}))
    else:
        print(columns([HEAD, *((name, *_cells(s)) for name, s in scores.items())]))
        print(f"{len(truths)} records; in brackets: 95 % intervals over records")
    return 0


def _cells(scores: scoring.Scores) -> tuple[str, ...]:
    def cell(interval: scoring.ScoreInterval, factor: float, digits: int) -> str:
        value, low, high = (f"{factor * v:.{digits}f}" for v in interval)
        return "–" if math.isnan(interval.value) else f"{value} [{low}, {high}]"

    percent = (scores.named_right, scores.false_names, scores.silent)
    plain = (cell(scores.brier, 1.0, 2), cell(scores.rank, 1.0, 1))
    return (*(cell(s, 100.0, 0) for s in percent), *plain, f"{100.0 * scores.answered:.0f}")


def _document(scores: scoring.Scores) -> dict[str, object]:
    values = {name: value for name, value in asdict(scores).items() if name != "answered"}
    finite = {n: None if math.isnan(v[0]) else list(v) for n, v in values.items()}
    return {**finite, "answered": scores.answered}


ACTIONS = {
    "make": Action("write a data set, and its truth apart", _add_make, _make),
    "run": Action("answer a data set by this project", _add_run, _run),
    "score": Action("score answers against the truth", _add_score, _score),
}
add_arguments, run = verb_of(ACTIONS)
