"""The plotly.js that a page carries: unchanged from npm, and enough for every figure."""

import base64
import gzip
import hashlib
import re
from pathlib import Path

from rsea_ros import report
from rsea_ros.report.page.bundle import PLANE, SHA256, VENDOR, VERSION, packed_plotly


def test_the_bundle_is_npms_with_its_licence():
    script = gzip.decompress(base64.b64decode(packed_plotly()))
    assert hashlib.sha256(script).hexdigest() == SHA256 and f"v{VERSION}".encode() in script[:200]
    assert "MIT License" in (VENDOR / "plotly-cartesian.LICENSE").read_text()


def test_every_figure_is_plane():
    """A surface needed the whole bundle: 2 MB of each page of a design, and 40 MB of every environment."""
    sources = (path.read_text(encoding="utf-8") for path in Path(report.__file__).parent.rglob("*.py"))
    drawn = {name for text in sources for name in re.findall(r'"type": "(\w+)"', text)}
    others = {"log", "linear", "rect", "line", "date", "category", "data"}
    assert "contour" in drawn and drawn <= PLANE | others
