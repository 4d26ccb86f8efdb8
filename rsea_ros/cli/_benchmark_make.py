"""`rsea benchmark make`: records of known truth, by a plant that shares no code with the model."""

from __future__ import annotations

import argparse
import runpy
from pathlib import Path

from rsea_ros.cli._output import path
from rsea_ros.cli._terminal import positive, progress, whole_number
from rsea_ros.errors import BenchmarkError, ParameterError

GENERATOR = Path(__file__).resolve().parents[2] / "bench" / "cause_naming.py"
SHORTEST, MOST = 16, 9999
"""Characters of a secret seed: shorter ones could be found by trying; records of a data set."""


def add_make(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of `make`."""
    add = parser.add_argument
    add("out", type=path, help="new folder for the data set; the truth goes beside it, OUT.truth.json")
    add("--records", type=whole_number, default=60, help=f"how many, 1 to {MOST} (default %(default)s)")
    add("--duration", type=positive, default=12.0, help="of each record, s, 5 to 600 (default %(default)g)")
    seeds = parser.add_mutually_exclusive_group()
    seeds.add_argument("--seed", type=whole_number, default=1, help="public seed (default %(default)s)")
    secret = f"file with a secret seed: any text of at least {SHORTEST} characters, for a hidden half"
    seeds.add_argument("--seed-file", type=path, help=secret)


def run(args: argparse.Namespace) -> int:
    """Write the data set and the truth, and print both paths."""
    if not GENERATOR.is_file():
        raise BenchmarkError(
            "make needs a clone of the repository: its plant is no part of the package"
        )
    if not 1 <= args.records <= MOST:
        raise ParameterError(f"--records {args.records}, expected 1 to {MOST}")
    if not 5.0 <= args.duration <= 600.0:
        raise ParameterError(f"--duration {args.duration:g} s, expected 5 to 600 s")
    text = _secret(args.seed_file) if args.seed_file else str(args.seed)
    with progress("benchmark") as tell:
        write = runpy.run_path(str(GENERATOR))["write"]
        truth = write(args.out, args.records, args.duration, text, tell)
    print(f"records     {args.out}\ntruth       {truth}: keep it apart")
    return 0


def _secret(file: Path) -> str:
    """Return the seed in a file. Raises ParameterError for one that could be found by trying."""
    from rsea_ros.benchmark.dataset import read_text

    text = read_text(file).strip()
    if len(text) < SHORTEST:
        raise ParameterError(f"{file}: {len(text)} characters, expected at least {SHORTEST} of a secret seed")
    return text
