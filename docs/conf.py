"""The docs site: `.ci/docs` builds it and treats warnings as errors. Generated pages are written here."""

from __future__ import annotations

import ast
import json
import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from rsea_ros import DOOR  # noqa: E402
from rsea_ros.documents.units import plain  # noqa: E402
from rsea_ros.effects.catalogue import EffectPage, catalogue  # noqa: E402
from rsea_ros.effects.parameter import MACHINE  # noqa: E402

project = "rsea_ros"
author = "The rsea_ros founders"
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.viewcode", "sphinx_copybutton"]
myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 3
html_theme = "furo"
html_title = "rsea_ros"
html_show_copyright = False
exclude_patterns = ["figures", "**.ipynb"]
autodoc_typehints = "description"
autodoc_member_order = "bysource"
suppress_warnings = ["myst.xref_missing"]
"""Links to files outside docs/, such as SECURITY.md, have no target on the site."""


def effects_page() -> str:
    """Return the catalogue of effects: meaning, equation, parameters and source of each."""
    parts = [
        "# The effects", "",
        "Every cause that a diagnosis can name. `rsea effects NAME` prints this text.", "",
        f"Bounds and sizes are for {MACHINE}: largest torque, spring, reflected inertia, largest "
        "speed, and rate of the paper's actuator in its high-impedance test. On another machine they are as "
        "many times larger as the column *grows with* says, in powers of four: 2 N·m of friction are typical "
        "where the largest torque is 30 N·m, 2 mN·m where it is 30 mN·m. Bounds in s and Hz only widen.", "",
    ]  # fmt: skip
    for name, effect in sorted(catalogue().items()):
        page = EffectPage(effect)
        rows = [
            f"| `{p.name}` | {plain(p.unit) or 1} | {p.typical:g} | {p.null:g} | {p.low:g} to {p.high:g} | "
            f"{page.grows_with(p)} | {p.reason} |"
            for p in page.parameters.values()
        ]
        alike = ", ".join(f"[`{n}`](#{n.replace('_', '-')})" for n in effect.claims.confusable_with)
        parts += [
            f"## {name}", "", f"{effect.about[:1].upper()}{effect.about[1:]}.", "",
            "```text", effect.equation, "```", "",
            "| parameter | unit | typical | vanishes at | fitted within | grows with | why these bounds |",
            "|---|---|---|---|---|---|---|", *rows, "",
            *([f"Look at: {effect.inspect}.", ""] if effect.inspect else []),
            *([f"Kind: {', '.join(effect.tags)}.", ""] if effect.tags else []),
            *([f"May be confused with {alike}.", ""] if alike else []),
            prose(page.description), "",
        ]  # fmt: skip
    return "\n".join(parts)


def prose(docstring: str) -> str:
    """Return a docstring as Markdown: indented lines stay as they are, the rest is plain text."""
    lines = docstring.splitlines()
    return "\n".join(s if s.startswith("    ") else re.sub(r"([*_<>|$\[\]`\\])", r"\\\1", s) for s in lines)


def api_page() -> str:
    """Return the reference of the door: every name that `import rsea_ros` offers."""
    parts = ["# Python API", "", "Everything that `import rsea_ros as rsea` offers.", ""]
    for name, module in DOOR.items():
        if name == "effects":
            parts += ["## effects", "", "A mapping of the [catalogue](effects.md) by name.", ""]
            continue
        kind = "autofunction" if name[0].islower() else "autoclass"
        members = [":members:"] if kind == "autoclass" else []
        parts += [f"## {name}", "", "```{eval-rst}", f".. {kind}:: rsea_ros.{module}.{name}",
                  *(f"   {m}" for m in members), "```", ""]  # fmt: skip
    return "\n".join(parts)


def decisions_page() -> str:
    """Return the list of decisions."""
    names = sorted(path.stem for path in (ROOT / "docs" / "decisions").glob("0*.md"))
    return "\n".join(["# Decisions", "", "```{toctree}", ":maxdepth: 1", "", *names, "```", ""])


def gallery_page() -> str:
    """Return the gallery: title, text, code and picture of each example."""
    parts = [
        "# Gallery", "",
        "Short examples of the Python library. Run one with `./rsea run docs/gallery/NAME.py` in a clone.",
        "`figure` is a plotly figure; `figure.show()` opens it. Tests run every example.", "",
    ]  # fmt: skip
    for path in sorted((ROOT / "docs" / "gallery").glob("*.py")):
        text = path.read_text(encoding="utf-8")
        title, _, about = (ast.get_docstring(ast.parse(text)) or "").partition("\n\n")
        code = text.split('"""\n', 2)[-1].strip()
        parts += [f"## {title.rstrip('.')}", "", about, "", f"![{title}]({path.stem}.png)", "",
                  f"[{path.name}]({path.name})", "", "```python", code, "```", ""]  # fmt: skip
    return "\n".join(parts)


def tutorial_notebook() -> str:
    """Return the tutorial as a Jupyter notebook without outputs: text and code alternate as in the page."""
    page = (ROOT / "docs" / "tutorial.md").read_text(encoding="utf-8")
    parts = re.split(r"```python\n(.*?)```\n", page, flags=re.DOTALL)
    cells = [cell(part.strip(), k, code=k % 2 == 1) for k, part in enumerate(parts) if part.strip()]
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    book = {"cells": cells, "metadata": {"kernelspec": kernel}, "nbformat": 4, "nbformat_minor": 5}
    return json.dumps(book, ensure_ascii=False, indent=1) + "\n"


def cell(text: str, number: int, *, code: bool) -> dict[str, object]:
    """Return a cell of a notebook."""
    common = {"id": f"cell-{number}", "metadata": {}, "source": text.splitlines(keepends=True)}
    if code:
        return {"cell_type": "code", "execution_count": None, "outputs": [], **common}
    return {"cell_type": "markdown", **common}


PAGES = {
    "effects.md": effects_page,
    "api.md": api_page,
    "decisions/index.md": decisions_page,
    "gallery/index.md": gallery_page,
    "tutorial.ipynb": tutorial_notebook,
}


def write_pages(app: object) -> None:
    """Write the generated pages beside the others."""
    for name, text in PAGES.items():
        path = ROOT / "docs" / name
        content = text()
        if not path.exists() or path.read_text(encoding="utf-8") != content:
            path.write_text(content, encoding="utf-8")


def setup(app: object) -> None:
    """Write the generated pages before Sphinx looks for sources."""
    write_pages(app)
