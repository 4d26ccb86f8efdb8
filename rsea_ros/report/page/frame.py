"""The frame of every report: one HTML file that needs no network, made of blocks from top to bottom."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from dataclasses import asdict
from html import escape, unescape
from pathlib import Path

from rsea_ros.report.figures.figure import Figure
from rsea_ros.report.json_values import strict
from rsea_ros.report.page.bundle import packed_plotly
from rsea_ros.report.page.html import section

_FOLDER = Path(__file__).parent

Block = Figure | str
"""A figure, or finished HTML."""


def page(title: str, kicker: str, blocks: Sequence[Block], footer: Sequence[str]) -> str:
    """Return the document. title: the verdict in a sentence. kicker: the subject, above the title."""
    body, contents = _number_sections("\n".join(_block(block, i) for i, block in enumerate(blocks)))
    plotly = packed_plotly() if any(isinstance(block, Figure) for block in blocks) else ""
    foot = "".join(f"<p>{escape(line)}</p>" for line in footer)
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
<script type="text/plain" id="plotly">{plotly}</script>
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
    if isinstance(block, str):
        return block
    name = f"figure-{index}"
    values = json.dumps(
        strict(asdict(block)), allow_nan=False, ensure_ascii=False, separators=(",", ":")
    ).replace("<", "\\u003c")
    drawing = (
        f'<div class="figure" id="{name}" style="height:{block.height}px" role="img" '
        f'aria-label="{escape(block.title)}"></div>'
        f'<script type="application/json" id="{name}-data">{values}</script>'
    )
    return section(block.title, drawing, caption=block.caption)


def _asset(name: str) -> str:
    return (_FOLDER / name).read_text(encoding="utf-8")
