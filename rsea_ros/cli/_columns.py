"""Rows of text in aligned columns."""

from __future__ import annotations

from collections.abc import Sequence

from rsea_ros.cli import _terminal as _lines
from rsea_ros.report.wrapped_lines import wrap

_NARROWEST = 16
"""Columns of the last cell at least; where fewer are left it is not wrapped."""


def columns(rows: Sequence[Sequence[str]]) -> str:
    """Return rows of equal length as lines with aligned cells; the last cell continues below itself."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    indent = sum(w + 2 for w in widths[:-1])
    width = _lines.columns()
    width = width if width - indent >= _NARROWEST else indent + widths[-1]
    lines = ("  ".join(c.ljust(w) for c, w in zip(r, widths, strict=True)).rstrip() for r in rows)
    return "\n".join(wrap(line, width, indent) if len(line) > width else line for line in lines)
