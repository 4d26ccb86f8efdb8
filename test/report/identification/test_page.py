"""The report of an identification as files and in a browser, and its table of parameters."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from rsea_ros.identification.result import Identification, ParameterEstimate
from rsea_ros.report.identification import (
    identification_json,
    identification_report,
    parameter_table,
    value_text,
    write_results,
)

LARGEST = 1_500_000
"""Bytes of a page without 3-D, here of 160 s at 280 Hz in three channels."""
FIGURES = 8
"""Two Bode figures, then time and spectrum of three channels."""
ZOOM = """(() => { const node = [...document.querySelectorAll(".figure")]
  .find((n) => n.layout.xaxis.title.text.startsWith("time"));
  window.samples = () => node.data[0].x.length;
  Plotly.relayout(node, {"xaxis.range[0]": 40, "xaxis.range[1]": 41}); })()"""


def test_browser_draws_every_figure_without_an_error(identification: Identification, shown) -> None:
    browser = shown(identification_report(identification))
    assert browser.errors == []
    assert browser.value("document.querySelectorAll('[data-drawn=yes]').length") == FIGURES
    assert browser.value("document.querySelectorAll('.main-svg').length") >= FIGURES
    browser.value(ZOOM)
    browser.until("280 <= samples() && samples() <= 284")  # a second of record with all its samples


def test_report_needs_no_network_and_stays_small(identification: Identification) -> None:
    html = identification_report(identification)
    head = html[: html.index('id="plotly"')]
    assert not re.search(r'(src|href)="(?!data:|#)', head)
    assert "url(" not in head
    assert len(html.encode()) <= LARGEST


def estimate(
    value: float, low: float, high: float, share: float = 1.0, name: str = "spring.stiffness"
) -> ParameterEstimate:
    return ParameterEstimate(name, value, "N m/rad", (low, high), 1530.0, 0.3, share)


@pytest.mark.parametrize(
    ("p", "answer"),
    [(estimate(1530.5, 1530.4, 1530.6), "yes"), (estimate(1530.5, 1530.4, 1530.6, 0.7), "in part"),
     (estimate(1530.5, 1530.4, 1530.6, 0.1), "no"), (estimate(350.0, -110.0, 810.0), "no"),
     (estimate(0.03, 0.0, 0.55), "no"), (estimate(200.0, 199.0, 200.0), "no"),
     (estimate(3.0, -np.inf, np.inf), "no"), (estimate(0.01, -0.02, 0.04), "no"),
     (estimate(0.01, -0.02, 0.04, name="torque_ripple.phase"), "yes")],
)  # fmt: skip
def test_a_value_within_its_doubt_or_at_a_bound_is_not_determined(p: ParameterEstimate, answer: str) -> None:
    assert p.determined == answer


@pytest.mark.parametrize(
    ("p", "text"),
    [(estimate(1530.4, 1500.4, 1560.4), "1530 ± 30"),
     (estimate(1391.3449, 1391.2849, 1530.511), "1391.345 −0.060/+139"),
     (estimate(3.467, 2.717, 3.798), "3.47 −0.75/+0.33"),
     (estimate(3.0, -np.inf, np.inf), "3.000")],
)  # fmt: skip
def test_a_lopsided_interval_is_shown_by_its_sides(p: ParameterEstimate, text: str) -> None:
    assert "".join(value_text(p)) == text
    assert value_text(p)[1] in parameter_table([p])


def test_json_holds_no_infinity_and_all_that_others_rely_on(identification: Identification) -> None:
    document = identification_json(identification)
    text = json.dumps(document, allow_nan=False)
    assert json.loads(text)["parameters"]["spring.damping"]["ci95"] == [None, None]
    inertia = document["parameters"]["rotor.reflected_inertia"]
    assert (inertia["value"], inertia["unit"]) == (0.95312, "kg m^2")
    assert document["correlation"]["matrix"][1][2] is None
    assert {"residual_rms", "noise_rms", "fit_percent", "statements", "data"} <= set(document)


def test_a_write_that_fails_leaves_nothing(identification: Identification, tmp_path: Path) -> None:
    (tmp_path / "report.html").mkdir()
    with pytest.raises(OSError, match=r"report\.html"):
        write_results(identification, tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == ["report.html"]
