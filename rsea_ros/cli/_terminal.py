"""What verbs print and read on a terminal: lines, columns, numbers, progress; safe for any encoding."""

import argparse
import codecs
import math
import os
import shutil
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from io import TextIOWrapper
from typing import Any, TextIO

from rsea_ros.documents.wording import printable
from rsea_ros.report.words import WIDTH, wrap

_NARROWEST, _NARROWEST_CELL = 40, 16
"""Columns of a line at least; of the last cell of a row: where fewer are left it is not wrapped."""


def width() -> int:
    """Return the width of printed lines: that of the terminal up to WIDTH; WIDTH in a pipe."""
    if sys.stdout is None or not sys.stdout.isatty():
        return WIDTH
    return max(_NARROWEST, min(WIDTH, shutil.get_terminal_size((WIDTH, 24)).columns))


def say(text: str, indent: int = 0) -> None:
    """Print text in lines that fit, all but the first indented. A path stays whole."""
    print(wrap(text, width(), indent), flush=True)


def columns(rows: Sequence[Sequence[str]]) -> str:
    """Return rows of equal length as lines with aligned cells; the last cell continues below itself."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    indent = sum(w + 2 for w in widths[:-1])
    most = width() if width() - indent >= _NARROWEST_CELL else indent + widths[-1]
    lines = ("  ".join(c.ljust(w) for c, w in zip(r, widths, strict=True)).rstrip() for r in rows)
    return "\n".join(wrap(line, most, indent) if len(line) > most else line for line in lines)


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

    name, step = TextColumn("{task.description}"), TextColumn("{task.fields[step]}")
    console = Console(stderr=True)
    with Progress(name, BarColumn(), TimeElapsedColumn(), step, console=console, transient=True) as bar:
        task = bar.add_task(title, total=1.0, step="")
        yield lambda step, share: bar.update(task, completed=share, step=printable(step))


_ASCII = {
    "·": "*", "×": "x", "±": "+-", "−": "-", "–": "-", "…": "...", "²": "^2", "³": "^3", "µ": "u",
    "°": " deg", "→": "->", "≤": "<=", "≥": ">=", "∞": "inf", "“": '"', "”": '"', "’": "'",
}  # fmt: skip


class EscapedStream:
    """A text stream that shows control characters; colours pass on a terminal."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._colours = stream.isatty()

    def write(self, text: str) -> int:
        self._stream.write(printable(text, colours=self._colours))
        return len(text)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


@contextmanager
def show_controls() -> Iterator[None]:
    """In this block stdout shows control characters, and stdout and stderr accept every character."""
    codecs.register_error("rsea", _instead)
    replaced = open_closed_streams()
    before = sys.stdout
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="rsea")
    sys.stdout = EscapedStream(before)
    try:
        yield
    finally:
        sys.stdout = before
        for name in replaced:
            getattr(sys, name).close()
            setattr(sys, name, None)


def open_closed_streams() -> list[str]:
    """Put the null device in the place of the standard streams that the parent process closed.

    Otherwise the next file that is opened takes their number, and what is printed ends in that file.
    Returns the names of those streams.
    """
    closed = [name for name in ("stdin", "stdout", "stderr") if getattr(sys, name) is None]
    for name in closed:
        setattr(sys, name, open(os.devnull, "r" if name == "stdin" else "w"))  # noqa: SIM115  closed by shown
    return closed


def _instead(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    part = error.object[error.start : error.end]
    return "".join(_ASCII.get(c) or c.encode("ascii", "backslashreplace").decode() for c in part), error.end
