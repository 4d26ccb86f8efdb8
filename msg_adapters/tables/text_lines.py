"""Lines of text files in blocks, in any common encoding, gzipped or not."""

from __future__ import annotations

import codecs
import gzip
import io
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, cast

BLOCK = 1 << 22
"""Characters that are held at a time."""
LONGEST = 1 << 20
"""Characters of a line. A table of numbers has some hundred."""
_HEAD = 1 << 16
_MARKS = {codecs.BOM_UTF8: "utf-8-sig", codecs.BOM_UTF16_LE: "utf-16", codecs.BOM_UTF16_BE: "utf-16"}


def blocks_of_lines(path: Path) -> Iterator[list[str]]:
    """Yield the lines of a file without their ends. Raises ValueError for a file that is not text."""
    rest = ""
    with _open(path) as file:
        text = io.TextIOWrapper(cast("IO[bytes]", file), encoding=_encoding(path), errors="replace")
        while chunk := text.read(BLOCK):
            lines = (rest + chunk).split("\n")
            rest = lines.pop()
            if len(rest) > LONGEST:
                raise ValueError(f"a line of more than {LONGEST} characters, expected a table of numbers")
            yield lines
    if rest:
        yield [rest]


@contextmanager
def _open(path: Path) -> Iterator[IO[bytes] | gzip.GzipFile]:
    if stat.S_ISFIFO(path.stat().st_mode):
        raise ValueError("is a pipe, expected a file")
    with gzip.open(path, "rb") if path.suffix == ".gz" else path.open("rb") as file:
        yield file


def _encoding(path: Path) -> str:
    """Return the encoding: by its mark, else UTF-8 where the beginning is that, else Latin-1."""
    with _open(path) as file:
        head = file.read(_HEAD)
    for mark, name in _MARKS.items():
        if head.startswith(mark):
            return name
    if b"\0" in head:
        raise ValueError("not a text (it has zero bytes), expected CSV or TSV in UTF-8")
    try:
        codecs.getincrementaldecoder("utf-8")().decode(head)
    except UnicodeDecodeError:
        return "latin-1"
    return "utf-8"
