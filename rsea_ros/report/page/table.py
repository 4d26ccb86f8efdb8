"""A plain table of text."""

from __future__ import annotations

from collections.abc import Container, Sequence
from html import escape


def table(head: Sequence[str], rows: Sequence[Sequence[str]], numbers: Container[int] = ()) -> str:
    """Return the HTML of a table; columns in `numbers` stand to the right. Cells are plain text."""

    def cell(tag: str, i: int, text: str) -> str:
        kind = " class='number'" if i in numbers else ""
        return f"<{tag}{kind}>{escape(text)}</{tag}>"

    top = "".join(cell("th", i, text) for i, text in enumerate(head))
    body = "".join(f"<tr>{''.join(cell('td', i, text) for i, text in enumerate(row))}</tr>" for row in rows)
    return f"<div class='scroll'><table><thead><tr>{top}</tr></thead><tbody>{body}</tbody></table></div>"
