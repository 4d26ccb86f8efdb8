"""What verbs print and read on a terminal: lines, numbers, progress."""

from __future__ import annotations

import argparse
import math
import shutil
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from rsea_ros.documents.wording import printable
from rsea_ros.report.wrapped_lines import WIDTH, wrap

if TYPE_CHECKING:
    from rich.table import Table


_NARROWEST = 40


def columns() -> int:
    """Return the width of printed lines: that of the terminal up to WIDTH; WIDTH in a pipe."""
    if sys.stdout is None or not sys.stdout.isatty():
        return WIDTH
    return max(_NARROWEST, min(WIDTH, shutil.get_terminal_size((WIDTH, 24)).columns))


def say(text: str, indent: int = 0) -> None:
    """Print text in lines that fit, all but the first indented. A path stays whole."""
    print(wrap(text, columns(), indent), flush=True)


def show(table: Table) -> None:
    """Print a table as wide as lines may be; cells that may wrap do."""
    from rich.console import Console

    Console(width=columns()).print(table)


def whole_number(text: str) -> int:
    """Return a whole number >= 0. Raises ArgumentTypeError for anything else."""
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"{text!r}, expected a whole number >= 0")
    return int(text)


def positive(text: str) -> float:
    """Return a finite number > 0. Raises ArgumentTypeError for any other."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and value > 0.0):
        raise argparse.ArgumentTypeError(f"{text!r}, expected a number > 0")
    return value


def whole_numbers(text: str) -> tuple[int, ...]:
    """Return the numbers of `2`, `0,1,2` or `0-5`, each once. Raises ArgumentTypeError for another text."""
    numbers: list[int] = []
    for part in text.split(","):
        first, dash, last = (side.strip() for side in part.partition("-"))
        if not (first.isdecimal() and len(first) < 5 and (not dash or (last.isdecimal() and len(last) < 5))):
            raise argparse.ArgumentTypeError(f"{text!r}, expected whole numbers >= 0: 2, or 0,1,2, or 0-5")
        numbers += range(int(first), int(last if dash else first) + 1)
    if not numbers:
        raise argparse.ArgumentTypeError(f"{text!r}, expected the smaller number first")
    return tuple(dict.fromkeys(numbers))


@contextmanager
def progress(title: str) -> Iterator[Callable[[str, float], None]]:
    """Yield a function (step, share done from 0 to 1) that draws a bar on stderr if stderr is a terminal."""
    if not sys.stderr.isatty():
        yield lambda step, share: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TimeElapsedColumn(),
        TextColumn("{task.fields[step]}"),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(title, total=1.0, step="")
        yield lambda step, share: bar.update(task, completed=share, step=printable(step))
