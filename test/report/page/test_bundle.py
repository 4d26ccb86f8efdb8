"""The plotly.js that a page carries: unchanged from npm, of plotly's version, whole only for 3-D."""

import base64
import gzip
import hashlib
import re
from pathlib import Path

from plotly.offline import get_plotlyjs_version

from rsea_ros import report
from rsea_ros.report.figures.figure import Figure
from rsea_ros.report.page.bundle import SHA256, VENDOR, VERSION, plotly_for


def script(*types):
    figure = Figure("", "", [{"type": kind} for kind in types], {})
    return gzip.decompress(base64.b64decode(plotly_for([figure])))


def test_the_two_dimensional_bundle_is_npms_and_of_plotlys_version():
    assert hashlib.sha256(script("scatter", "bar", "heatmap")).hexdigest() == SHA256
    assert get_plotlyjs_version() == VERSION
    assert f"v{VERSION}".encode() in script("scatter")[:200]


def test_the_licence_of_the_bundle_is_shipped():
    assert "MIT License" in (VENDOR / "plotly-cartesian.LICENSE").read_text()


def test_only_pages_with_3d_carry_the_whole_bundle():
    assert len(script("scatter", "surface")) > 3 * len(script("scatter"))


def test_no_figure_without_3d_needs_the_whole_bundle():
    """The points of a law were drawn by WebGL: its page had 2.3 MB."""
    files = Path(report.__file__).parent.rglob("*.py")
    sources = {path.stem: path.read_text(encoding="utf-8") for path in files}
    drawn = {name for name, text in sources.items() if re.search(r'"type": "\w*(gl|3d|surface)"', text)}
    assert drawn == {"surface"}
