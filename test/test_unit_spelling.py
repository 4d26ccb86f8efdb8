"""Units in what people read are spelled in one way, `N·m`; a unit alone may stand as files have it, `N m`."""

from __future__ import annotations

import ast
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
FOLDERS = ("rsea_ros", "msg_adapters", "bench")
SPACED = re.compile(r"(?<![A-Za-z(])[mk]?N ?m(?![A-Za-z])|kg m\^2")
ALONE = re.compile(r"(1/|rad/)?\(?([mk]?N ?m|kg m\^2)\)?(\^\d)?( s(\^\d)?)?((/\(?(rad|s|A)\)?)(\^\d)?){0,2}")
READ_AS_FILES = (
    "units.py", "effect_source.py", "column_units.py", "factors.py", "bench/inputs/tables.py",
)  # fmt: skip
"""Modules that read units, or write files."""
MODULES = sorted(p for f in FOLDERS for p in (ROOT / f).rglob("*.py") if not str(p).endswith(READ_AS_FILES))


def texts(path: Path) -> list[str]:
    """Return the texts of a module that are no docstrings, parts of f-strings too."""
    nodes = list(ast.walk(ast.parse(path.read_text(encoding="utf-8"))))
    docstrings = {id(n.value) for n in nodes if isinstance(n, ast.Expr)}
    return [n.value for n in nodes if _is_text(n) and id(n) not in docstrings]


def _is_text(node: ast.AST) -> bool:
    return isinstance(node, ast.Constant) and isinstance(node.value, str)


def test_messages_tables_and_plots_spell_units_in_one_way():
    """The page of `rsea control` had `N m` in its key numbers and `N·m` in its plots."""
    wrong = {
        f"{path.relative_to(ROOT)}: {text!r}"
        for path in MODULES
        for text in texts(path)
        if SPACED.search(text) and not ALONE.fullmatch(text)
    }
    assert wrong == set()


def test_the_docs_spell_units_in_one_way():
    """Import maps and rigs show what a file may hold: code, and the rows that list spellings."""
    code = re.compile(r"```(yaml|text)?\n.*?```|`[^`]*`", flags=re.DOTALL)
    pages = {page.name: page.read_text(encoding="utf-8") for page in (ROOT / "docs").rglob("*.md")}
    wrong = {name: SPACED.findall(code.sub("", text)) for name, text in pages.items()}
    assert {name: found for name, found in wrong.items() if found} == {}
