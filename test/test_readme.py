"""The code in the README runs as written."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def test_the_python_of_the_readme_runs_and_names_the_cause(capsys):
    (code,) = re.findall(r"```python\n(.*?)```", README, flags=re.DOTALL)
    exec(compile(code, "README.md", "exec"), {})
    printed = capsys.readouterr().out
    assert "spring.stiffness" in printed
    name, gap = printed.splitlines()[-1].split()
    assert name == "backlash"
    assert abs(float(gap) - 4e-3) < 1e-4


def test_every_link_of_the_readme_leads_to_a_file():
    links = re.findall(r"\]\((?!https?:)([^)#]+)", README)
    missing = [link for link in links if not (ROOT / link).exists()]
    assert links and missing == []


def test_the_readme_is_short():
    assert len(README.splitlines()) <= 150
