"""What a browser shows of the pages of a fleet: colours, months, days."""

from __future__ import annotations

from itertools import pairwise

import pytest

from rsea_ros.report.fleet.page import write_fleet_report

COLOURS = (
    """[...document.querySelectorAll('.rail i:last-child')].map((i) => getComputedStyle(i).backgroundColor)"""
)
CELLS = """[...document.querySelectorAll('.heat svg [class^=u], .heat svg [class^=d]')]
  .map((c) => getComputedStyle(c).fill)"""
MONTHS = """[...document.querySelectorAll('.months')].map((m) => [...m.children]
  .map((c) => c.getBoundingClientRect()).map((r) => [r.left, r.right]))"""


@pytest.fixture(scope="module")
def fleet_in_browser(tables, browser, tmp_path_factory):
    browser.open(write_fleet_report(*tables, tmp_path_factory.mktemp("fleet") / "out").as_uri())
    browser.until("document.querySelector('.heat')")
    return browser


def test_bars_and_cells_have_their_colours_in_a_browser(fleet_in_browser):
    """A script took `--before` in the style for an option of a command: no bar was seen, all cells black."""
    bars, cells = fleet_in_browser.value(COLOURS), fleet_in_browser.value(CELLS)
    assert bars and set(bars) == {"rgb(217, 115, 13)"}
    assert cells and set(cells) <= {"rgb(217, 115, 13)", "rgb(24, 100, 171)"}


@pytest.mark.parametrize("width", [1400, 400, 320])
def test_names_of_months_do_not_overlap(fleet_in_browser, width):
    """On a phone the names of five months lay on each other."""
    fleet_in_browser.size(width, 900)
    rows = fleet_in_browser.value(MONTHS)
    assert rows
    for row in rows:
        assert len(row) > 1 and row[0][0] >= 0.0 and row[-1][1] <= width
        assert all(before[1] <= after[0] for before, after in pairwise(row))


def test_the_axis_of_a_few_days_names_days(young, fleet_in_browser):
    """It named noons, and days as Americans write them."""
    fleet_in_browser.open(young.as_uri())
    fleet_in_browser.until("document.querySelector('.xtick text')")
    ticks = fleet_in_browser.value("[...document.querySelectorAll('.xtick text')].map((t) => t.textContent)")
    assert ticks[:3] == ["1 Jan2025", "2 Jan", "3 Jan"]
