"""Damaged files in batches: each batch is one child that makes and reads files, one after another.

A batch keeps each file that brought a new answer, and damages it further: a cheap stand-in for the coverage
of code, which reaches the code behind the first check.
"""

from __future__ import annotations

import json
import os
import random
import re
import signal
import time
import traceback
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from types import FrameType

from bench.inputs.formats import FORMATS, SHARES, Format
from bench.inputs.outcome import Outcome, limit_memory, limit_seconds, more_memory, outcome_of_end, place

BATCH = 50
SLOW = 20
"""s of processor for one file, above which it counts as endless: all of them are small."""


WALL = 1200
"""s after which a batch that neither computes nor ends is ended, as a crash."""


class _TooSlow(BaseException):
    """Raised by the timer, past every `except Exception`."""


def batches(seed: int, count: int) -> Iterator[tuple[Format, int]]:
    """Yield the format of each batch and a seed for it, formats by their shares and by turns."""
    shares = [f for f in FORMATS for _ in range(SHARES.get(f.name, 1))]
    number = 0
    while number * BATCH < count:
        yield shares[number % len(shares)], seed * 1_000_003 + number
        number += 1


def files_of(form: Format, seed: int, answers: dict[str, bytes]) -> Iterator[tuple[int, bytes]]:
    """Yield number and content of the files of a batch. answers: the file of each, from the reader."""
    rng = random.Random(seed)
    seeds = list(form.seeds())
    for number in range(BATCH):
        kept = list(answers.values())
        base = rng.choice(kept) if kept and rng.random() < 0.5 else rng.choice(seeds)
        yield (
            number,
            (base if number < len(seeds) and seed % 7 == 0 else form.damage(rng, base, rng.choice(seeds))),
        )


def read_batch(form: Format, seed: int, folder: Path, log: Path, after: int = -1) -> None:
    """Make and read the files of a batch; write a line of JSON for each. after: the last one already read."""
    signal.signal(signal.SIGVTALRM, _stop)
    signal.alarm(WALL)
    limit_memory()
    answers: dict[str, bytes] = {}
    with log.open("a", encoding="utf-8") as file:
        for number, data in files_of(form, seed, answers):
            if number <= after:
                continue
            (folder / "last").write_bytes(data)
            file.write(f"{number}\n")
            file.flush()
            outcome = _read(form, folder, data, number)
            answers.setdefault(_pattern(outcome), data)
            if outcome.is_fault:
                (folder / f"fault-{number}").write_bytes(data)
            file.write(json.dumps(asdict(outcome)) + "\n")
            file.flush()


def _read(form: Format, folder: Path, data: bytes, number: int) -> Outcome:
    signal.setitimer(signal.ITIMER_VIRTUAL, SLOW)
    limit_seconds(SLOW + 5)
    began = time.process_time()
    try:
        outcome = form.play(folder, data, number)
    except _TooSlow as error:
        outcome = Outcome("time-out", place(error))
    except MemoryError as error:
        more_memory()
        outcome = Outcome("memory", place(error))
    except BaseException as error:
        outcome = Outcome("traceback", place(error), "".join(traceback.format_exception(error))[-3000:])
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0)
        limit_seconds(WALL)  # the next file may take long to make
    if "_TooSlow" in outcome.where:
        outcome.kind = "time-out"
    limit_memory()
    outcome.seconds = time.process_time() - began
    return outcome


def _stop(number: int, frame: FrameType | None) -> None:
    raise _TooSlow(f"more than {SLOW} s")


def _pattern(outcome: Outcome) -> str:
    return outcome.kind + re.sub(r"'[^']*'|\d+|\S*/\S*", "#", outcome.where or outcome.detail)[:120]


def run(seed: int, count: int, folder: Path, jobs: int, only: list[str]) -> Iterator[tuple[str, Outcome]]:
    """Read all batches in `jobs` children at a time; yield name and outcome of every file."""
    waiting = [
        (form, number, -1)
        for form, number in batches(seed, count)
        if all(text in f"{form.name} {number}" for text in only)
    ]
    running: dict[int, tuple[Format, int, Path]] = {}
    while waiting or running:
        while waiting and len(running) < jobs:
            form, number, after = waiting.pop(0)
            inside = folder / f"{form.name}-{number}"
            inside.mkdir(exist_ok=True)
            running[_fork(form, number, inside, after)] = (form, number, inside)
        pid, status, usage = os.wait4(-1, 0)
        form, number, inside = running.pop(pid)
        done = list(_lines(inside / "log"))
        unfinished = [k for k, outcome in done if outcome is None]
        if unfinished:
            _finish(inside / "log", outcome_of_end(status, usage))
            (inside / f"fault-{unfinished[-1]}").write_bytes((inside / "last").read_bytes())
            waiting.insert(0, (form, number, unfinished[-1]))
            continue
        if status or len(done) < BATCH:
            where = f"a batch ended with status {status} after {len(done)} of {BATCH} files"
            yield f"{form.name} {number}", Outcome("gate", where)
        for k, outcome in done:
            if outcome is not None:
                yield f"{form.name} {number} {k} ({inside}/fault-{k})", outcome


def _fork(form: Format, seed: int, inside: Path, after: int) -> int:
    pid = os.fork()
    if pid:
        return pid
    try:
        read_batch(form, seed, inside, inside / "log", after)
        os._exit(0)
    except BaseException:
        traceback.print_exc()
    finally:
        os._exit(70)


def _lines(log: Path) -> Iterator[tuple[int, Outcome | None]]:
    """Yield number and outcome of each file, None for the one at which the child ended."""
    number = None
    for line in log.read_text(encoding="utf-8").splitlines() if log.exists() else ():
        if line.isdigit():
            number = int(line)
        elif number is not None:
            yield number, Outcome(**json.loads(line))
            number = None
    if number is not None:
        yield number, None


def _finish(log: Path, outcome: Outcome) -> None:
    with log.open("a", encoding="utf-8") as file:
        file.write(json.dumps(asdict(outcome)) + "\n")
