"""The docs say what the code does: the tutorial runs, the catalogue is the code's, links lead somewhere."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
MADE = {"api.md", "index.md"}
"""Pages that the site's build makes."""


@pytest.fixture(scope="module")
def site() -> ModuleType:
    """Return docs/conf.py as a module."""
    spec = importlib.util.spec_from_file_location("docs_conf", DOCS / "conf.py")
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_tutorial_runs_and_finds_the_play(capsys):
    blocks = re.findall(r"```python\n(.*?)```", (DOCS / "tutorial.md").read_text(), flags=re.DOTALL)
    names: dict[str, object] = {}
    for block in blocks:
        exec(compile(block, "tutorial.md", "exec"), names)
    assert names["fit"].verdict == "misfit"
    assert names["cause"].name == "backlash"
    assert names["cause"].parameters["gap"].value == pytest.approx(4e-3, rel=0.02)
    assert names["after"]["ft"].rms_error < 0.1 * names["before"]["ft"].rms_error


def test_the_catalogue_of_the_docs_is_that_of_the_code(site):
    """`.ci/docs` makes it anew."""
    assert (DOCS / "effects.md").read_text(encoding="utf-8").strip() == site.effects_page().strip()


def test_the_reference_has_every_name_of_the_door(site):
    page = site.api_page()
    assert all(f"## {name}\n" in page for name in site.DOOR)


@pytest.mark.parametrize("path", sorted(DOCS.rglob("*.md")), ids=lambda path: path.name)
def test_every_link_leads_to_a_file(path):
    links = re.findall(r"\]\((?!https?:|#)([^)#]+)", path.read_text(encoding="utf-8"))
    missing = [link for link in links if not (path.parent / link).exists() and Path(link).name not in MADE]
    assert missing == []


def test_every_page_stands_in_the_contents():
    index = (DOCS / "index.md").read_text(encoding="utf-8")
    pages = {path.stem for path in DOCS.glob("*.md")} - {"index"}
    assert all(re.search(rf"^{page}$", index, flags=re.MULTILINE) for page in pages), pages
