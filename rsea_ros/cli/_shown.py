"""Output of the verbs, safe for any terminal and any encoding."""

from __future__ import annotations

import codecs
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from io import TextIOWrapper
from typing import Any, TextIO

from rsea_ros.documents.wording import printable

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
        """Write text."""
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
    """Return the replacement for characters that an encoding lacks."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    part = error.object[error.start : error.end]
    return "".join(_ASCII.get(c) or c.encode("ascii", "backslashreplace").decode() for c in part), error.end
