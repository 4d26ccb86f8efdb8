"""plotly.js for a page: the bundle of plane figures, the npm package plotly.js-cartesian-dist-min.

It is unchanged but packed; its MIT licence lies beside it.
"""

from __future__ import annotations

import base64
from functools import lru_cache
from pathlib import Path

VENDOR = Path(__file__).parent / "vendor"
VERSION = "4.1.1"
SHA256 = "79542150855a52c567260e3137095dbe2b744e6d702a5cabe67da246942fba7a"
"""Of plotly-cartesian.min.js as npm has it."""
PLANE = {
    "bar", "box", "contour", "heatmap", "histogram", "histogram2d", "histogram2dcontour", "image", "pie",
    "scatter", "scatterternary", "violin",
}  # fmt: skip
"""Types of traces that it draws, as its README lists them."""


@lru_cache(maxsize=1)
def packed_plotly() -> str:
    """Return plotly.js as base64 of gzip; page.js unpacks it in the browser."""
    return base64.b64encode((VENDOR / "plotly-cartesian.min.js.gz").read_bytes()).decode("ascii")
