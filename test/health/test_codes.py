"""The table of fault codes in the docs, on which fault managers rely, is that of the code."""

import re
from pathlib import Path

from rsea_ros.health.health_finding import NAMES, TABLE
from rsea_ros.health.hypotheses import hypotheses_of
from rsea_ros.model.rig_file import load_rig

PAGE = Path(__file__).resolve().parents[2] / "docs" / "health.md"


def test_the_docs_have_the_table():
    page = PAGE.read_text(encoding="utf-8")
    rows = re.findall(r"^\| `(RSEA_\w+)` \| (.*?) \| (.*?) ?\|$", page, re.MULTILINE)
    assert rows == [tuple(code) for code in TABLE]


def test_every_hypothesis_has_a_code_of_the_table():
    assert {h.code for h in hypotheses_of(load_rig("paper_high_impedance"), 1.0 / 280.0)} <= set(NAMES)
