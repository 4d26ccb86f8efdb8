"""The code in the README runs as written."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
RESULTS = (ROOT / "docs" / "results.md").read_text(encoding="utf-8")


def test_every_link_of_the_readme_leads_to_a_file():
    links = re.findall(r"\]\((?!https?:)([^)#]+)", README)
    missing = [link for link in links if not (ROOT / link).exists()]
    assert links and missing == []


def test_the_readme_is_short():
    assert len(README.splitlines()) <= 150


def test_the_numbers_of_the_readme_are_those_of_the_results():
    """One page said 22 of 23 where the other said 23 of 23."""
    hidden = r"on (\d+) records.*hidden\s+effect, the right one of (\d+) comes first in (\d+) %; "
    others = r"of three, all are named in (\d+) %; ([\d.]+) % of the names called `confirmed`"
    (numbers,) = re.findall(hidden + others, README, flags=re.DOTALL)
    (total,) = re.findall(r"has (\d+) effects, and all (\d+) records", RESULTS)
    one, three, wrong = (
        float(re.search(rf"^\| {row}, % \| ([\d.]+) \|", RESULTS, flags=re.MULTILINE)[1])
        for row in ("first cause right, one effect", "all causes right, three drawn at random",
                    "confirmed names that are wrong")
    )  # fmt: skip
    assert numbers == (*reversed(total), f"{one:.0f}", f"{three:.0f}", f"{wrong:g}")
