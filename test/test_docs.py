"""Docs and generated files agree with the code: catalogue, policies, names; links lead to files."""

import importlib.util
import re
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
MADE = {"api.md", "index.md"}
"""Pages that the build of the site writes."""


@pytest.fixture(scope="module")
def site() -> ModuleType:
    """Return docs/conf.py as a module."""
    spec = importlib.util.spec_from_file_location("docs_conf", DOCS / "conf.py")
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_catalogue_of_the_docs_is_that_of_the_code(site):
    """`.ci/docs` regenerates it."""
    assert (DOCS / "effects.md").read_text(encoding="utf-8").strip() == site.effects_page().strip()


def test_the_reference_has_every_name_of_the_door(site):
    page = site.api_page()
    assert all(f"## {name}\n" in page for name in site.DOOR)


def test_every_link_leads_to_a_file():
    links = [
        (path, link)
        for path in (ROOT / "README.md", *sorted(DOCS.rglob("*.md")))
        for link in re.findall(r"\]\((?!https?:|#)([^)#]+)", path.read_text(encoding="utf-8"))
    ]
    lost = [(p.name, x) for p, x in links if not (p.parent / x).exists() and Path(x).name not in MADE]
    assert links and lost == []


def test_every_page_is_in_the_contents():
    index = (DOCS / "index.md").read_text(encoding="utf-8")
    pages = {path.stem for path in DOCS.glob("*.md")} - {"index"}
    assert all(re.search(rf"^{page}$", index, flags=re.MULTILINE) for page in pages), pages


def test_the_notebook_is_the_tutorial(site):
    """`.ci/docs` regenerates it."""
    assert (DOCS / "tutorial.ipynb").read_text(encoding="utf-8") == site.tutorial_notebook()


def test_the_numbers_of_the_readme_are_those_of_the_results():
    """One page said 22 of 23 where the other said 23 of 23."""
    readme, results = ((ROOT / name).read_text(encoding="utf-8") for name in ("README.md", "docs/results.md"))
    hidden = r"on (\d+) records.*hidden\s+effect, the right one of (\d+) comes first in (\d+) %; "
    others = r"of three, all are named in (\d+) %; ([\d.]+) % of the names called `confirmed`"
    (numbers,) = re.findall(hidden + others, readme, flags=re.DOTALL)
    (total,) = re.findall(r"has (\d+) effects, and all (\d+) records", results)
    one, three, wrong = (
        float(re.search(rf"^\| {row}, % \| ([\d.]+) \|", results, flags=re.MULTILINE)[1])
        for row in ("first cause right, one effect", "all causes right, three drawn at random",
                    "confirmed names that are wrong")
    )  # fmt: skip
    assert numbers == (*reversed(total), f"{one:.0f}", f"{three:.0f}", f"{wrong:g}")
