"""The page of every result: one HTML file that needs no network, made of blocks from top to bottom.

A block is a figure under its finding, or a section: a finding, tables and sentences. Text is escaped
wherever it is not yet Html.
"""

import base64
import json
import re
from collections.abc import Callable, Iterable, Sequence
from functools import lru_cache
from html import escape, unescape
from pathlib import Path
from typing import TypeVar

from rsea_ros.report.figures.figure import Figure
from rsea_ros.report.result_files import Provenance, strict

_FOLDER = Path(__file__).parent
VENDOR = _FOLDER / "vendor"
"""plotly.js 4.1.1, the bundle of plane figures as npm has it in plotly.js-cartesian-dist-min, packed; its MIT
licence beside it."""
_NUMBER = " class='number'"
Item = TypeVar("Item")


@lru_cache(maxsize=1)
def packed_plotly() -> str:
    """Return plotly.js as base64 of gzip; page.js unpacks it in the browser."""
    return base64.b64encode((VENDOR / "plotly-cartesian.min.js.gz").read_bytes()).decode("ascii")


class Html(str):
    """Finished HTML."""

    __slots__ = ()


Block = Figure | Html


def html(text: str) -> str:
    """Return text as HTML, finished HTML as it is."""
    return text if isinstance(text, Html) else escape(text)


def page(
    title: str, kicker: str, blocks: Iterable[Block], footer: Sequence[str] = (),
    provenance: Provenance | None = None,
) -> str:  # fmt: skip
    """Return the document. title: the verdict in a sentence. kicker: the subject, above the title."""
    blocks = list(blocks)
    body, contents = _number_sections("\n".join(_block(block, i) for i, block in enumerate(blocks)))
    figures = [block for block in blocks if isinstance(block, Figure)]
    foot = "".join(f"<p>{escape(line)}</p>" for line in (*footer, *(provenance.lines if provenance else ())))
    return f"""<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="color-scheme" content="light dark">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{escape(title)}</title>
<link rel="icon" href="data:,">
<style>{_asset("page.css")}</style>
</head>
<body>
<main>
<header><p class="kicker">{escape(kicker)}</p><h1>{escape(title)}</h1>{contents}</header>
{body}
<footer>{foot}</footer>
</main>
<script type="text/plain" id="plotly">{packed_plotly() if figures else ""}</script>
<script>{_asset("page.js")}</script>
</body>
</html>
"""


def _number_sections(body: str) -> tuple[str, str]:
    """Return a body whose sections have names, and the table of contents that leads to them."""
    titles: list[str] = []

    def name(match: re.Match[str]) -> str:
        titles.append(unescape(re.sub("<[^>]*>", "", match[3])))
        return f'<section id="part-{len(titles)}"{match[1]}>{match[2] or ""}<h2>{match[3]}</h2>'

    numbered = re.sub(r"<section([^>]*)>(<details><summary>)?<h2>(.*?)</h2>", name, body, flags=re.S)
    items = "".join(f'<li><a href="#part-{i}">{escape(t)}</a></li>' for i, t in enumerate(titles, 1))
    contents = f"<nav><details><summary>Contents</summary><ol>{items}</ol></details></nav>" if items else ""
    return numbered, contents


def _block(block: Block, index: int) -> str:
    if isinstance(block, Html):
        return block
    name = f"figure-{index}"
    values = json.dumps(strict(block), allow_nan=False, ensure_ascii=False, separators=(",", ":"))
    drawing = (
        f'<div class="figure" id="{name}" style="height:{block.height}px" role="img" '
        f'aria-label="{escape(block.title)}"></div>'
        f'<script type="application/json" id="{name}-data">' + values.replace("<", "\\u003c") + "</script>"
    )
    return section(block.title, Html(drawing), caption=block.caption)


def _asset(name: str) -> str:
    return (_FOLDER / name).read_text(encoding="utf-8")


def section(title: str, *blocks: str, caption: str = "") -> Html:
    """Return a section under its finding; a text is a paragraph of it."""
    under = f'<p class="caption">{escape(caption)}</p>' if caption else ""
    return Html(f"<section><h2>{escape(title)}</h2>{under}{''.join(map(paragraph, blocks))}</section>")


def fold(title: str, *blocks: str) -> Html:
    """Return a section that opens when its title is clicked, for details."""
    return Html(
        f'<section class="folded"><details><summary><h2>{escape(title)}</h2></summary>'
        f"{''.join(map(paragraph, blocks))}</details></section>"
    )


def paragraph(text: str, kind: str = "") -> Html:
    """Return text as a paragraph, finished HTML and nothing as they are. kind: caption, next, under."""
    if isinstance(text, Html) or not text:
        return Html(text)
    return Html(f'<p class="{kind}">{escape(text)}</p>' if kind else f"<p>{escape(text)}</p>")


def key_numbers(items: Iterable[tuple[str, str]]) -> Html:
    """Return large numbers in a row: (number, meaning)."""
    cells = "".join(f"<div><b>{html(value)}</b><span>{escape(what)}</span></div>" for value, what in items)
    return Html(f'<div class="keys">{cells}</div>')


def bullets(items: Iterable[str]) -> Html:
    """Return a list of sentences."""
    return Html(f"<ul>{''.join(f'<li>{html(item)}</li>' for item in items)}</ul>")


def equation(text: str) -> Html:
    """Return an equation in plain text, set apart."""
    return Html(f'<div class="equation">{escape(text)}</div>')


def code(text: str) -> Html:
    """Return text to be typed literally."""
    return Html(f"<code>{escape(text)}</code>")


def listed(items: Iterable[Item], *columns: tuple[str, Callable[[Item], str]]) -> Html:
    """Return a table with a row for each item. columns: (title, what of an item stands there)."""
    return table([title for title, _ in columns], [[of(item) for _, of in columns] for item in items])


def table(head: Sequence[str], rows: Iterable[Sequence[str]], kind: str = "") -> Html:
    """Return a table. A title that begins with # is that of a column of numbers. kind: its class."""
    kinds = [_NUMBER if title.startswith("#") else "" for title in head]
    top = "".join(f"<th{kind}>{html(t.removeprefix('#'))}</th>" for t, kind in zip(head, kinds, strict=True))
    cells = ("".join(f"<td{kind}>{html(c)}</td>" for c, kind in zip(row, kinds, strict=True)) for row in rows)
    body = "".join(f"<tr>{row}</tr>" for row in cells)
    kind = f" class='{kind}'" if kind else ""
    top = f"<thead><tr>{top}</tr></thead>" if any(head) else ""
    return Html(f"<div class='scroll'><table{kind}>{top}<tbody>{body}</tbody></table></div>")


def named(plain: str, name: str, strong: bool = False) -> Html:
    """Return a cell: a plain name, and below it, small, the name in files."""
    plain = f"<b>{html(plain)}</b>" if strong else html(plain)
    return Html(f"{plain}<small>{escape(name)}</small>")


def bar(share: float, colour: str, ground: str, width: float = 180.0) -> Html:
    """Return a share of one as a small bar; one below zero is empty."""
    length = width * min(max(share, 0.0), 1.0)
    return Html(
        f'<svg class="interval" viewBox="0 0 {width:g} 18" aria-hidden="true">'
        f'<rect x="0" y="3" width="{width:g}" height="12" rx="2" fill="{ground}"/>'
        f'<rect x="0" y="3" width="{length:.1f}" height="12" rx="2" fill="{colour}"/></svg>'
    )
