"""The docs site: `.ci/docs` builds it, warnings are errors. Pages that follow from the code are made here."""

from __future__ import annotations

import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from rsea_ros import DOOR  # noqa: E402
from rsea_ros.effects import scale  # noqa: E402
from rsea_ros.effects._page import EffectPage  # noqa: E402
from rsea_ros.effects.catalogue import catalogue  # noqa: E402

project = "rsea_ros"
author = "The rsea_ros founders"
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.viewcode", "sphinx_copybutton"]
myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 3
html_theme = "furo"
html_title = "rsea_ros"
exclude_patterns = ["figures"]
autodoc_typehints = "description"
autodoc_member_order = "bysource"
suppress_warnings = ["myst.xref_missing"]
"""Links to files of the repository beside the docs, such as SECURITY.md, lead nowhere on the site."""


def effects_page() -> str:
    """Return the catalogue: meaning, equation, parameters and source of each effect."""
    parts = [
        "# The effects", "", "What a diagnosis can name. `rsea effects NAME` shows the same.", "",
        "Bounds and sizes are those for the paper's actuator in its high-impedance test: largest torque "
        f"{scale.TORQUE:g} N m, spring {scale.STIFFNESS:g} N m/rad, reflected inertia {scale.INERTIA:g} "
        f"kg m^2, largest speed {scale.SPEED:g} rad/s, {1.0 / scale.PERIOD:.0f} samples a second. On another "
        "machine they are as many times larger as the column *grows with* says, in powers of four: 2 N m of "
        "friction are typical where the largest torque is 30 N m, 2 mN m where it is 30 mN m. Bounds in s "
        "and Hz only widen.", "",
    ]  # fmt: skip
    for name, effect in sorted(catalogue().items()):
        page = EffectPage(effect)
        rows = [
            f"| `{p.name}` | {p.unit} | {p.typical:g} | {p.null:g} | {p.low:g} to {p.high:g} | "
            f"{page.goes_with(p).removeprefix(', times ')} | {p.reason} |"
            for p in page.parameters.values()
        ]
        alike = ", ".join(f"[`{n}`](#{n.replace('_', '-')})" for n in effect.claims.confusable_with)
        parts += [
            f"## {name}", "", f"{effect.about[:1].upper()}{effect.about[1:]}.", "",
            "```text", effect.equation, "```", "",
            "| parameter | unit | typical | vanishes at | fitted within | grows with | why these bounds |",
            "|---|---|---|---|---|---|---|", *rows, "",
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


PAGES = {"effects.md": effects_page, "api.md": api_page, "decisions/index.md": decisions_page}


def write_pages(app: object) -> None:
    """Write the pages that follow from the code beside the others."""
    for name, text in PAGES.items():
        path = ROOT / "docs" / name
        content = text()
        if not path.exists() or path.read_text(encoding="utf-8") != content:
            path.write_text(content, encoding="utf-8")


def setup(app: object) -> None:
    """Have the pages written before Sphinx looks for sources."""
    write_pages(app)
