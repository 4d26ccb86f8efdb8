"""docs/settings.md shows a curve of outcomes for every setting whose reason points to it."""

from __future__ import annotations

from pathlib import Path

from rsea_ros.diagnosis.settings import DEFAULT

PAGE = Path(__file__).parents[2] / "docs" / "settings.md"


def test_every_curve_is_that_of_a_setting_which_points_to_it_and_holds_its_value():
    sections = PAGE.read_text(encoding="utf-8").split("\n## ")[1:]
    curves = {section.split("\n")[0]: section for section in sections}
    pointing = {s.name: s for s in DEFAULT.numbers() if "docs/settings.md" in s.reason}
    assert curves.keys() == pointing.keys() and len(curves) == 10
    for name, setting in pointing.items():
        assert f"| **{setting.value:g}** |" in curves[name], name
        assert ("Flat:" in curves[name]) == setting.reason.startswith("flat"), name
