"""Text in lines that fit a terminal and a page of a log."""

from __future__ import annotations

import textwrap

WIDTH = 100
"""Columns of a line at most, where nothing says how wide the terminal is."""
LABEL = 12
"""Columns of the label that a row begins with."""


def wrap(text: str, width: int = WIDTH, indent: int = 0) -> str:
    """Return text in lines of at most `width` columns, all but the first indented.

    A word that is longer, such as a path, stays whole.
    """
    lines = textwrap.wrap(
        text, width, subsequent_indent=" " * indent, break_long_words=False, break_on_hyphens=False
    )
    return "\n".join(lines)


def row(label: str, text: str, width: int = WIDTH) -> str:
    """Return a label and its text, which continues below itself."""
    return wrap(f"{label:<{LABEL}}{text}", width, LABEL)


def command_row(label: str, text: str, command: str, width: int = WIDTH) -> str:
    """Return a label, its text, and a command, which is never broken: it is to be copied."""
    line = f"{label:<{LABEL}}{text} {command}"
    return line if len(line) <= width else f"{row(label, text, width)}\n{' ' * LABEL}{command}"
