"""Parts of a page: contents, folds, provenance, correlation, sketch, and the plotly.js that it carries."""

import base64
import gzip
import hashlib
import json
import re
from pathlib import Path

import numpy as np
import pytest

from rsea_ros import report
from rsea_ros.effects.catalogue import catalogue
from rsea_ros.identification.result import Identification
from rsea_ros.report.diagnosis.figures import part_of, sketch
from rsea_ros.report.identification import correlation_finding, correlation_section, identification_report
from rsea_ros.report.page import VENDOR, Html, fold, packed_plotly, page, section
from rsea_ros.report.result_files import json_text, provenance_of

SHA256 = "79542150855a52c567260e3137095dbe2b744e6d702a5cabe67da246942fba7a"
"""Of plotly-cartesian.min.js 4.1.1."""
PLANE = {
    "bar", "box", "contour", "heatmap", "histogram", "histogram2d", "histogram2dcontour", "image", "pie",
    "scatter", "scatterternary", "violin",
}  # fmt: skip
"""Types of traces that it draws, as its README lists them."""


def test_every_section_is_in_the_contents_and_can_be_reached():
    html = page("t", "k", [section("One & two"), fold("Three", Html("<p>x</p>"))], [])
    links = re.findall(r'<a href="#(part-\d)">(.*?)</a>', html)
    assert links == [("part-1", "One &amp; two"), ("part-2", "Three")]
    assert all(f'<section id="{name}"' in html for name, _ in links)


def test_a_page_says_which_software_made_it_from_which_files(identification: Identification, tmp_path: Path):
    bag = tmp_path / "a <bag>"
    bag.mkdir()
    (bag / "x.mcap").write_bytes(b"12")
    (bag / "metadata.yaml").write_bytes(b"3")
    provenance = provenance_of(["rsea", "identify", "a <bag>"], [bag])
    assert provenance.files[str(bag)] == hashlib.sha256(b"312").hexdigest()
    html = identification_report(identification, provenance)
    assert "rsea identify &#x27;a &lt;bag&gt;&#x27;" in html and provenance.files[str(bag)][:12] in html
    assert json.loads(json_text({"schema": 1}, provenance))["provenance"]["sha256"] == provenance.files


def test_the_most_correlated_pair_is_named():
    matrix = np.array([[1.0, -0.97, 0.2], [-0.97, 1.0, np.nan], [0.2, np.nan, 1.0]])
    names = ["rotor.reflected_damping", "spring.damping", "spring.stiffness"]
    said = correlation_finding(names, matrix)
    assert said.startswith("Strongly correlated: ") and "(−0.97)" in said
    weak = np.where(np.eye(3, dtype=bool), 1.0, 0.1 * matrix)
    assert correlation_finding(names, weak).startswith("No two are strongly correlated")
    assert correlation_section(names, matrix).count("<td class='number'") == 9
    assert correlation_section(names[:1], matrix[:1, :1]) == ""


@pytest.mark.parametrize(
    ("name", "part"),
    [
        ("coulomb_friction", "gear"),
        ("backlash", "spring"),
        ("command_delay", "command"),
        ("torque_constant_error", "motor"),
        ("ft_gain_error", "F/T sensor"),
        ("base_compliance", "support"),
    ],
)
def test_the_culprit_is_marked_where_it_sits(name, part):
    assert part_of(catalogue()[name]) == part
    (marked,) = re.findall('class="culprit"><b>(.*?)</b>', sketch([name]))
    assert marked == part


def test_the_bundle_is_npms_with_its_licence():
    script = gzip.decompress(base64.b64decode(packed_plotly()))
    assert hashlib.sha256(script).hexdigest() == SHA256 and b"v4.1.1" in script[:200]
    assert "MIT License" in (VENDOR / "plotly-cartesian.LICENSE").read_text()


def test_every_figure_is_plane():
    """A surface needed the whole bundle: 2 MB of each page of a design, and 40 MB of every environment."""
    package = Path(report.__file__).parents[1]
    sources = (
        p.read_text(encoding="utf-8")
        for part in ("report", "paper")
        for p in package.rglob(f"{part}/**/*.py")
    )
    drawn = {name for text in sources for name in re.findall(r'"type": "(\w+)"', text)}
    others = {"log", "linear", "rect", "line", "date", "category", "data"}
    assert "contour" in drawn and drawn <= PLANE | others
