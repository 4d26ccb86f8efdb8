"""The docs agree with the code: the tutorial runs, the catalogue is that of the code, links lead to files."""

from __future__ import annotations

import importlib.util
import re
import runpy
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


def test_the_tutorial_runs_and_finds_the_play(capsys):
    blocks = re.findall(r"```python\n(.*?)```", (DOCS / "tutorial.md").read_text(), flags=re.DOTALL)
    names: dict[str, object] = {}
    for block in blocks:
        exec(compile(block, "tutorial.md", "exec"), names)
    assert names["dx"].verdict == "explained"  # it began in mid-motion, and a rest stayed unexplained
    assert names["fit"].verdict == "misfit"
    assert names["cause"].name == "backlash"
    assert names["cause"].parameters["gap"].value == pytest.approx(4e-3, rel=0.02)
    assert names["after"]["ft"].rms_error < 0.1 * names["before"]["ft"].rms_error
    assert names["loop"].error(settle=1.0) < 0.25


def test_the_catalogue_of_the_docs_is_that_of_the_code(site):
    """`.ci/docs` regenerates it."""
    assert (DOCS / "effects.md").read_text(encoding="utf-8").strip() == site.effects_page().strip()


def test_the_reference_has_every_name_of_the_door(site):
    page = site.api_page()
    assert all(f"## {name}\n" in page for name in site.DOOR)


@pytest.mark.parametrize("path", sorted(DOCS.rglob("*.md")), ids=lambda path: path.name)
def test_every_link_leads_to_a_file(path):
    links = re.findall(r"\]\((?!https?:|#)([^)#]+)", path.read_text(encoding="utf-8"))
    missing = [link for link in links if not (path.parent / link).exists() and Path(link).name not in MADE]
    assert missing == []


def test_every_page_is_in_the_contents():
    index = (DOCS / "index.md").read_text(encoding="utf-8")
    pages = {path.stem for path in DOCS.glob("*.md")} - {"index"}
    assert all(re.search(rf"^{page}$", index, flags=re.MULTILINE) for page in pages), pages


def test_the_notebook_is_the_tutorial(site):
    """`.ci/docs` regenerates it."""
    assert (DOCS / "tutorial.ipynb").read_text(encoding="utf-8") == site.tutorial_notebook()


EXAMPLES = {
    "identify_a_bench": lambda names: names["stiffness"].value == pytest.approx(1400.0, rel=0.01),
    "name_a_cause": lambda names: names["cause"].name == "coulomb_friction",
    "estimate_both_torques": lambda names: names["share"][0] < 0.1 < 0.3 < names["share"][-1],
    "compare_effects": lambda names: all(_rms(change) > 0.1 for change in names["changes"].values()),
    "choose_a_spring": lambda names: (names["exact"] < names["printed"]).all(),
    "position_loop": lambda names: names["damping"].value == pytest.approx(0.65, rel=0.02),
}
"""Each example of the gallery, and what holds of its variables after it ran."""


def _rms(y) -> float:
    return float((y**2).mean() ** 0.5)


def test_every_example_of_the_gallery_is_tested_and_has_a_picture():
    assert {path.stem for path in (DOCS / "gallery").glob("*.py")} == set(EXAMPLES)
    assert {path.stem for path in (DOCS / "gallery").glob("*.png")} == set(EXAMPLES)


@pytest.mark.parametrize("name", EXAMPLES)
def test_the_examples_of_the_gallery_run(name, capsys):
    names = runpy.run_path(str(DOCS / "gallery" / f"{name}.py"))
    assert EXAMPLES[name](names)
    assert len(names["figure"].data) > 0
