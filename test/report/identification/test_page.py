"""The report as a browser sees it, and as a file."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from html import escape
from pathlib import Path

from rsea_ros.identification.result import Identification
from rsea_ros.report.identification.page import identification_report
from rsea_ros.report.identification.words import doubt_sentences, next_command, verdict_sentence

Browser = Callable[[str, Path], tuple[str, str]]
LARGEST = 1_500_000
"""Bytes of a page without 3-D, here of 160 s at 280 Hz in three channels."""
FIGURES = 8
"""Two Bode figures, then time and spectrum of three channels."""
ZOOM = """<script>setTimeout(() => {
  const all = [...document.querySelectorAll(".figure")];
  const node = all.find((n) => n.layout.xaxis.title.text.startsWith("time"));
  Plotly.relayout(node, {"xaxis.range[0]": 40, "xaxis.range[1]": 41}).then(() => setTimeout(() => {
    document.body.dataset.zoomed = node.data[0].x.length;
  }, 500));
}, 3000);</script></body>"""


def test_browser_draws_every_figure_without_an_error(
    identification: Identification, opened: Browser, tmp_path: Path
) -> None:
    document, log = opened(identification_report(identification).replace("</body>", ZOOM), tmp_path)
    assert "CONSOLE" not in log
    assert document.count('data-drawn="yes"') == FIGURES
    assert len(re.findall(r'class="main-svg"', document)) >= FIGURES
    zoomed = re.search(r'data-zoomed="(\d+)"', document)
    assert zoomed is not None
    assert 280 <= int(zoomed.group(1)) <= 284, "a second of record is drawn with all its samples"


def test_report_needs_no_network_and_stays_small(identification: Identification) -> None:
    html = identification_report(identification)
    head = html[: html.index('id="plotly"')]
    assert not re.search(r'(src|href)="(?!data:|#)', head)
    assert "url(" not in head
    assert len(html.encode()) <= LARGEST


def test_foreign_text_is_escaped(identification: Identification) -> None:
    html = identification_report(identification)
    assert "bench &amp; &lt;friends&gt;" in html
    assert "<friends>" not in html


def test_the_verdict_names_the_channel_above_its_noise(identification: Identification) -> None:
    assert re.fullmatch(
        r"The model fits: .* (0|1)\.\d\d times the noise \(rig paper_high_impedance\)",
        verdict_sentence(identification),
    )
    poor = replace(identification, noise_rms={**identification.noise_rms, "ft": 0.01})
    assert verdict_sentence(poor).startswith("The model does not fit: F/T torque 3 times the noise (rig ")
    assert next_command(poor) == "rsea diagnose 'runs/bench & <friends>' --rig paper_high_impedance"
    assert escape(next_command(poor)) in identification_report(poor)


def test_an_alternative_is_written_as_a_proper_name(identification):
    missed = replace(identification, residual_rms={"ft": 1.0}, alternatives=("coulomb_friction", "backlash"))
    (said,) = doubt_sentences(missed)
    assert "what Coulomb friction or backlash would make" in said
