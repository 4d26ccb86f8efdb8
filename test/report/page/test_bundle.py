"""The plotly.js that a page carries: unchanged from npm, of plotly's version, whole only for 3-D."""

import base64
import gzip
import hashlib

from plotly.offline import get_plotlyjs_version

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
