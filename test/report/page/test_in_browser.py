"""Pages on a phone, and while the colours of the system change, in a real browser."""

from __future__ import annotations

import json
from contextlib import closing

import pytest

from rsea_ros.report.diagnosis.sketch import sketch, upright_sketch
from rsea_ros.report.figures.figure import Figure, layout
from rsea_ros.report.figures.palette import INK
from rsea_ros.report.page.frame import page
from test.watch.browser import Browser

CAUSE = ["ft_gain_error"]
CURVE = Figure("Rising", "", [{"type": "scatter", "x": [0, 1], "y": [0, 1], "name": "y"}], layout())
SHOWN = """[...document.querySelectorAll('.sketch .culprit .cause')].map((e) => e.getBoundingClientRect())
  .filter((r) => r.width > 0).map((r) => [r.left, r.right, r.height])"""
COLOUR = "document.querySelector('.figure').layout.font.color"
LIGHT, DARK = ([{"name": "prefers-color-scheme", "value": value}] for value in ("light", "dark"))


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    folder = tmp_path_factory.mktemp("page")
    (folder / "page.html").write_text(page("t", "k", [sketch(CAUSE) + upright_sketch(CAUSE), CURVE], []))
    with closing(Browser(folder)) as made:
        made.open((folder / "page.html").as_uri())
        made.until("document.querySelector('[data-drawn]')")
        yield made


@pytest.mark.parametrize("width", [1400, 400, 320])
def test_the_name_of_the_culprit_is_in_view_and_can_be_read(browser, width):
    """At 400 px the drawing ended behind the encoder, and the F/T sensor was out of view."""
    browser.size(width, 900)
    ((left, right, height),) = browser.value(SHOWN)
    assert 0.0 <= left < right <= width and height > 10.0


def test_figures_follow_the_colours_of_the_system(browser):
    """Curves drawn in the dark kept their grid on a page that had become white."""
    for look, expected in ((DARK, "#e4e7eb"), (LIGHT, INK)):
        browser.call("Emulation.setEmulatedMedia", features=look)
        browser.until(f"({COLOUR}) === {json.dumps(expected)}", seconds=5.0)
    browser.until("document.querySelectorAll('.tools').length === 1")
    assert browser.errors == []
