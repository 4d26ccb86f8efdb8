"""`rsea benchmark run`: the answers of this project to a data set."""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterator
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Any

from rsea_ros.cli._output import add_force, path
from rsea_ros.cli._terminal import progress, say
from rsea_ros.errors import RseaError
from rsea_ros.outputs.new_files import check_free, write_text
from rsea_ros.progress import Progress

if TYPE_CHECKING:
    from rsea_ros.benchmark.dataset import Dataset

ENTRIES = ("diagnose", "largest_gain")


def add_run(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of `run`."""
    parser.add_argument("dataset", type=path, help="folder of the data set")
    entry = "diagnose, or the effect that leaves least when fitted alone (default %(default)s)"
    parser.add_argument("--entry", choices=ENTRIES, default="diagnose", help=entry)
    parser.add_argument("--out", type=path, help="answers, JSON lines (default ENTRY.jsonl)")
    add_force(parser)


def run(args: argparse.Namespace) -> int:
    """Answer every record, and print the path of the answers."""
    from rsea_ros.benchmark.dataset import read_dataset

    out = args.out or Path(f"{args.entry}.jsonl")
    check_free([out], force=args.force)
    dataset = read_dataset(args.dataset)
    partial = out.with_name(f"{out.name}.partial")
    with progress("benchmark") as tell:
        lines = list(_lines(dataset, args.entry, partial, tell))
    write_text(out, "".join(f"{json.dumps(line)}\n" for line in lines), force=args.force)
    partial.unlink()
    print(f"answers     {out}: {len(lines)} records")
    refused = [line["error"] for line in lines if "error" in line]
    if refused:
        say(f"refused     {len(refused)} records, no effect named; the first: {refused[0]}", indent=12)
    print(f"next        rsea benchmark score {quote(str(args.dataset))} {quote(str(out))}")
    return 0


def _lines(dataset: Dataset, entry: str, partial: Path, tell: Progress) -> Iterator[dict[str, Any]]:
    """Yield the answer to each record for JSON.

    partial: keeps the answers as they come; a run that was stopped goes on from there.
    """
    known = _kept_answers(dataset, entry, partial)
    for number, name in enumerate(dataset.hashes):
        tell(name, number / len(dataset.hashes))
        if name not in known:
            known[name] = _answer(dataset, entry, name)
            marked = ({**line, "entry": entry, "truth": dataset.hashes[n]} for n, line in known.items())
            write_text(partial, "".join(f"{json.dumps(line)}\n" for line in marked), force=True)
        yield known[name]


def _kept_answers(dataset: Dataset, entry: str, partial: Path) -> dict[str, dict[str, Any]]:
    """Return the answers of a stopped run of this entry to these very records, by record."""
    kept = {}
    for text in partial.read_text(encoding="utf-8").splitlines() if partial.exists() else ():
        try:
            line = json.loads(text)
        except ValueError:  # empty, or cut off by hand
            continue
        if line.pop("entry") == entry and dataset.hashes.get(line["record"]) == line.pop("truth"):
            kept[line["record"]] = line
    return kept


def _answer(dataset: Dataset, entry: str, name: str) -> dict[str, Any]:
    """Return the answer to a record; one that cannot be diagnosed names no effect."""
    from rsea_ros.benchmark.dataset import Answer
    from rsea_ros.benchmark.scoring import ENTRIES as FUNCTIONS
    from rsea_ros.model.rig_file import load_rig

    record, rig = dataset.record(name), load_rig(dataset.rig_path(name))
    start, failure = time.monotonic(), {}
    try:
        answer = FUNCTIONS[entry](record, rig)
    except RseaError as error:
        answer, failure = Answer(), {"error": str(error)}
    seconds = round(time.monotonic() - start, 2)
    return {**Answer(answer.causes, seconds).line(name), **failure}
