"""Tables of a page. A title that begins with # is that of a column of numbers."""

from __future__ import annotations

from collections.abc import Container, Iterable, Sequence
from html import escape

_NUMBER = " class='number'"


def table(head: Sequence[str], rows: Sequence[Sequence[str]], numbers: Container[int] = ()) -> str:
    """Return the HTML of a table of plain text; columns in `numbers` stand to the right."""
    marked = [f"#{title}" if i in numbers else title for i, title in enumerate(head)]
    return table_of_cells(marked, [[escape(cell) for cell in row] for row in rows])


def table_of_cells(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table of finished HTML cells."""
    kinds = [_NUMBER if title.startswith("#") else "" for title in head]
    cells = ("".join(f"<td{kind}>{c}</td>" for c, kind in zip(row, kinds, strict=True)) for row in rows)
    return table_of_rows(head, (f"<tr>{row}</tr>" for row in cells))


def table_of_rows(head: Sequence[str], rows: Iterable[str]) -> str:
    """Return a table of finished HTML rows."""
    top = "".join(_title(title) for title in head)
    body = "".join(rows)
    return f"<div class='scroll'><table><thead><tr>{top}</tr></thead><tbody>{body}</tbody></table></div>"


def _title(title: str) -> str:
    return f"<th{_NUMBER}>{escape(title[1:])}</th>" if title.startswith("#") else f"<th>{escape(title)}</th>"
