"""Printed lines that fit the terminal."""

from __future__ import annotations

import shutil
import sys
from typing import TYPE_CHECKING

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
