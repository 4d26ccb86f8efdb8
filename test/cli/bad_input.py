"""Shared by the tests of bad input: run a verb as a person does, check a refusal, damage a record."""

from __future__ import annotations

import io
import subprocess
import sys
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

from rsea_ros.cli.main import main
from rsea_ros.records.record import Channel, Record

ROOT = Path(__file__).resolve().parents[2]


def rsea(*arguments: str | Path, before: Callable[[], None] | None = None):
    """Run a verb in this process, or in a child where `before` must change the process first."""
    command = [str(argument) for argument in arguments]
    if before is not None:
        return subprocess.run(
            [sys.executable, "-m", "rsea_ros", *command],
            cwd=ROOT, capture_output=True, text=True, timeout=60.0, preexec_fn=before, check=False,
        )  # fmt: skip
    with redirect_stdout(io.StringIO()) as out, redirect_stderr(io.StringIO()) as err:
        status = main(command)
    return subprocess.CompletedProcess(command, status, out.getvalue(), err.getvalue())


def assert_refused(done: subprocess.CompletedProcess[str], *words: str | Path) -> None:
    """Check that the outcome is status 2 and one line with everything that a person needs."""
    assert (done.returncode, done.stdout) == (2, ""), done.stderr
    assert done.stderr.count("\n") == 1, done.stderr
    assert done.stderr.startswith("rsea ")
    for word in words:
        assert str(word) in done.stderr, done.stderr


def change(record: Record, name: str, k: int, *, y: float | None = None, t: float | None = None) -> Record:
    values, stamps = record[name].y.copy(), record[name].t.copy()
    values[k] = values[k] if y is None else y
    stamps[k] = stamps[k] if t is None else t
    return record.with_channels(**{name: Channel(stamps, values)})


def without(record: Record, *names: str) -> Record:
    return Record({n: c for n, c in record.channels.items() if n not in names})
