"""Parts of a page as finished HTML: sections, sentences, equations, numbers in a row."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape


def section(title: str, *blocks: str, caption: str = "") -> str:
    """Return a section of finished HTML under a heading; titles and captions are plain text."""
    under = f'<p class="caption">{escape(caption)}</p>' if caption else ""
    return f"<section><h2>{escape(title)}</h2>{under}{''.join(blocks)}</section>"


def fold(title: str, *blocks: str) -> str:
    """Return a section that opens when its title is clicked, for details."""
    return (
        f'<section class="folded"><details><summary><h2>{escape(title)}</h2></summary>'
        f"{''.join(blocks)}</details></section>"
    )


def key_numbers(items: Sequence[tuple[str, str]]) -> str:
    """Return large numbers in a row: (number, meaning)."""
    cells = "".join(f"<div><b>{escape(value)}</b><span>{escape(what)}</span></div>" for value, what in items)
    return f'<div class="keys">{cells}</div>'


def bullets(items: Sequence[str]) -> str:
    """Return a list of plain sentences."""
    return f"<ul>{''.join(f'<li>{escape(item)}</li>' for item in items)}</ul>"


def equation(text: str) -> str:
    """Return an equation in plain text, set apart."""
    return f'<div class="equation">{escape(text)}</div>'


def code(text: str) -> str:
    """Return text to be typed literally."""
    return f"<code>{escape(text)}</code>"


def paragraph(text: str) -> str:
    """Return plain text as a paragraph."""
    return f"<p>{escape(text)}</p>"
