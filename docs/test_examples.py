"""The code of README, tutorial and gallery runs as written; played by `.ci/docs`, not by the suite."""

from __future__ import annotations

import re
import runpy
from pathlib import Path

import pytest

DOCS = Path(__file__).parent


def test_the_python_of_the_readme_runs_and_names_the_cause(capsys):
    readme = (DOCS.parent / "README.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"```python\n(.*?)```", readme, flags=re.DOTALL)
    exec(compile(code, "README.md", "exec"), {})
    printed = capsys.readouterr().out
    assert "spring.stiffness" in printed
    name, gap = printed.splitlines()[-1].split()
    assert name == "backlash"
    assert abs(float(gap) - 4e-3) < 1e-4


def test_the_tutorial_runs_and_finds_the_play(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
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
