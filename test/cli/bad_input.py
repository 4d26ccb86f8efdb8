"""Shared by the tests of bad input: run a verb as a person does, or work in a fork; damage a record."""

import io
import os
import subprocess
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

from rsea_ros.cli.main import main
from rsea_ros.records.record import Channel, Record

ROOT = Path(__file__).resolve().parents[2]


def rsea(*arguments: str | Path):
    """Run a verb as a person does, in this process."""
    command = [str(argument) for argument in arguments]
    with redirect_stdout(io.StringIO()) as out, redirect_stderr(io.StringIO()) as err:
        status = main(command)
    return subprocess.CompletedProcess(command, status, out.getvalue(), err.getvalue())


def forked(work: Callable[[], object]) -> int:
    """Do work in a fork of this process, which has imported all; return its status, negative for a signal."""
    pid = os.fork()
    if pid == 0:
        status = 1
        try:
            work()
            status = 0
        finally:
            os._exit(status)
    return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])


class Calls:
    """The system's calls for rsea_ros.outputs.files; before the n-th of some of them something happens."""

    def __init__(self, names, n, happens):
        self.names, self.left, self._happens = names, n, happens

    def __getattr__(self, name):
        call = getattr(os, name)
        if name not in self.names:
            return call

        def count(*arguments, **options):
            self.left -= 1
            if self.left == 0:
                self._happens(name)
            return call(*arguments, **options)

        return count


def change(record: Record, name: str, k: int, *, y: float | None = None, t: float | None = None) -> Record:
    values, stamps = record[name].y.copy(), record[name].t.copy()
    values[k] = values[k] if y is None else y
    stamps[k] = stamps[k] if t is None else t
    return record.with_channels(**{name: Channel(stamps, values)})
