"""The pages of a fleet: their first sentence, their links, and that a browser draws them."""

from __future__ import annotations

import re

import pytest

from rsea_ros.errors import OutputError
from rsea_ros.report.fleet.links import page_names
from rsea_ros.report.fleet.page import write_fleet_report
from rsea_ros.trends import alarms


@pytest.fixture(scope="module")
def pages(tables, tmp_path_factory):
    """The pages by file name, without the bundle that draws figures."""
    store = tmp_path_factory.mktemp("store")
    shown = store / next(a for a in alarms(*tables) if a.joint == "hip").artefacts
    shown.mkdir(parents=True)
    (shown / "diagnosis.json").write_text("{}")
    index = write_fleet_report(*tables, store.parent / "out", store=store)
    texts = {p.name: p.read_text(encoding="utf-8") for p in index.parent.iterdir()}
    return {n: re.sub(r'<script type="text/plain" id="plotly">.*?</script>', "", t) for n, t in texts.items()}


def test_links_lead_to_the_joints_and_to_the_diagnosis_that_shows_it(pages, tables):
    for target in re.findall(r'href="(joint-[^"]*)"', pages["index.html"]):
        assert target in pages
    first = next(a for a in alarms(*tables) if a.joint == "hip")
    assert f'href="../store0/{first.artefacts}/diagnosis.json"' in pages["index.html"]


def test_foreign_names_are_escaped(pages):
    assert not any("<left>" in text for text in pages.values())


def test_pages_stay_small_and_ask_for_nothing(pages):
    for text in pages.values():
        assert len(text) < 120_000
        assert not re.search(r'(src|href)="(https?:)?//', text)


def test_no_page_is_written_over_what_is_there(tables, tmp_path):
    (tmp_path / "index.html").write_text("mine")
    with pytest.raises(OutputError):
        write_fleet_report(*tables, tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == ["index.html"]


def test_a_browser_draws_a_joint_without_an_error(tables, opened, tmp_path):
    write_fleet_report(*tables, tmp_path / "out")
    document, log = opened((tmp_path / "out" / "joint-hip.html").read_text(encoding="utf-8"), tmp_path)
    assert "CONSOLE" not in log
    assert document.count('data-drawn="yes"') == 2


def test_joints_whose_names_become_alike_have_pages_of_their_own():
    names = page_names(("a b", "a-b", "A b"))
    assert len({n.lower() for n in names.values()}) == 3
