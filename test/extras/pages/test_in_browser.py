"""What a browser shows of the pages of a fleet: joints, numbers, days."""

from __future__ import annotations

import pytest

from rsea_extras.pages.page import write_fleet_report

ROWS = """[...document.querySelectorAll('.figure')].filter((f) => f.data[0].type === 'heatmap')
  .map((f) => [...f.querySelectorAll('.ytick text')].map((t) => t.textContent))"""
PRESS = "[...document.querySelectorAll('.tools button')].filter((b) => b.textContent === 'CSV')[1].click()"


@pytest.fixture(scope="module")
def fleet_in_browser(tables, browser, tmp_path_factory):
    browser.open(write_fleet_report(*tables, tmp_path_factory.mktemp("fleet") / "out").as_uri())
    browser.until("document.querySelectorAll('.tools').length > 2")
    return browser


def test_a_map_names_its_joints_and_gives_its_numbers(fleet_in_browser, tables):
    assert fleet_in_browser.errors == []
    assert set(fleet_in_browser.value(ROWS)[0]) == set(tables[0]["joint"])
    fleet_in_browser.value("save = (name, text) => { window.saved = text; }")
    fleet_in_browser.value(PRESS)
    head, first, *_ = fleet_in_browser.value("window.saved").splitlines()
    assert head.count(" <left>: ") == 2 and first.count("2025-") == len(set(tables[0]["joint"]))


def test_the_axis_of_a_few_days_names_days(young, fleet_in_browser):
    """It named noons, and days as Americans write them."""
    fleet_in_browser.open(young.as_uri())
    fleet_in_browser.until("document.querySelector('.xtick text')")
    ticks = fleet_in_browser.value("[...document.querySelectorAll('.xtick text')].map((t) => t.textContent)")
    assert ticks[:3] == ["1 Jan2025", "2 Jan", "3 Jan"]
